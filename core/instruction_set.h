#pragma once

/// Inlined into one function for each instruction set, which then decides how loops are vectorised.
#define INSITU_KERNEL inline __attribute__((always_inline))

/// Attributes of the functions that are compiled for one instruction set: x86-64 only.
#define INSITU_TARGET_AVX2 __attribute__((target("avx2")))
#define INSITU_TARGET_AVX512 \
    __attribute__((target("avx512f,avx512bw,avx512vl,avx512dq,prefer-vector-width=512")))

namespace insitu {

/// Instruction sets that hot loops are compiled for. All give the same bytes: no fused
/// multiply-add (cmake/warnings.cmake), and no sum whose order depends on a vector's width.
enum class InstructionSet { Base, Avx2, Avx512 };

/// The best that this machine has.
[[nodiscard]] InstructionSet bestInstructionSet();

}  // namespace insitu
