#include "capture/deghost.h"
