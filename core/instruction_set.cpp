#include "core/instruction_set.h"

namespace insitu {

InstructionSet bestInstructionSet()
{
#if defined(__x86_64__)
    static const InstructionSet best = [] {
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
            __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq"))
            return InstructionSet::Avx512;
        return __builtin_cpu_supports("avx2") ? InstructionSet::Avx2 : InstructionSet::Base;
    }();
    return best;
#else
    return InstructionSet::Base;
#endif
}

}  // namespace insitu
