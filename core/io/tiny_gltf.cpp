// The one place where tinygltf's implementation is compiled. Debian's shared library would also
// do, but it reads files and images in its own way.
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wtype-limits"
#define TINYGLTF_IMPLEMENTATION
#include "core/io/gltf_library.h"
