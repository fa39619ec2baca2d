# The include check itself: it must accept a right tree and refuse each kind of wrong include.
# Use: cmake -D SCRATCH=<folder> -P tests/check_includes_test.cmake
cmake_minimum_required(VERSION 3.25)

# check(accept|refuse <file> <its text>), in a tree where calib/solve.h is public.
function(check expected file text)
  file(REMOVE_RECURSE ${SCRATCH})
  file(WRITE ${SCRATCH}/calib/CMakeLists.txt
       "insitu_module(calib\n  HEADERS solve.h\n  SOURCES solve.cpp private.cpp)\n")
  file(WRITE ${SCRATCH}/${file} "${text}\n")
  execute_process(COMMAND ${CMAKE_COMMAND} -D ROOT=${SCRATCH} -P
                          ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/check_includes.cmake
                  RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  set(actual refuse)
  if(code EQUAL 0)
    set(actual accept)
  endif()
  if(NOT actual STREQUAL expected)
    message(SEND_ERROR "${file} with '${text}': ${actual}, not ${expected}\n${output}")
  endif()
endfunction()

check(accept calib/solve.cpp "#include \"core/image.h\"\n#include <ceres/ceres.h>")
check(accept calib/private.h "#include \"core/io/json.h\"\n#include <ceres/ceres.h>")
check(accept apps/cli/command_calibrate.cpp "#include \"calib/solve.h\"")
check(refuse apps/cli/command_calibrate.cpp "#include \"calib/private.h\"")
check(refuse calib/solve.cpp "#include \"render/path_tracer.h\"")
check(refuse core/deep/down/image.h "#include \"calib/solve.h\"")
check(refuse render/tracer.h "  #  include  \"pipeline/project.h\"")
check(refuse calib/solve.cpp "#include \"solve.h\"")
check(refuse calib/solve.h "#include <ceres/ceres.h>")
check(refuse calib/solve.h "#include \"calib/private.h\"")
check(refuse nothing/here.h "#include <vector>")
