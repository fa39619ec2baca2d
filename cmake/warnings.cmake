# What every target of ours is compiled with: one interface target, linked by the functions.
add_library(insitu_options INTERFACE)
target_compile_features(insitu_options INTERFACE cxx_std_20)
target_compile_options(insitu_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wconversion
  -Wno-sign-conversion -Werror
  # One rounding for every build: a fused multiply-add would change results with -march.
  -ffp-contract=off)
if(INSITU_NATIVE)
  target_compile_options(insitu_options INTERFACE -march=native)
  # Ceres is linked as its package built it. Code of Eigen that both instantiate must agree on how
  # memory is aligned, which wider vectors or a sanitizer would change for ours alone.
  target_compile_definitions(insitu_options INTERFACE EIGEN_MAX_ALIGN_BYTES=16)
endif()
if(INSITU_SANITIZE)
  target_compile_options(insitu_options INTERFACE -fsanitize=${INSITU_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(insitu_options INTERFACE -fsanitize=${INSITU_SANITIZE})
  target_compile_definitions(insitu_options INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()
if(NOT CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(INSITU_CCACHE ccache)
  if(INSITU_CCACHE)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${INSITU_CCACHE})
  endif()
endif()
