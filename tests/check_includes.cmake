# Fails when a source includes against the direction of the modules (docs/architecture.md), when an
# include of ours does not name its folder, or when a public header (one that its module's
# CMakeLists.txt lists under HEADERS) shows a library or a header that users of the package do not
# get. Use: cmake -D ROOT=<checkout> -P tests/check_includes.cmake
cmake_minimum_required(VERSION 3.25)

set(modules core capture calib reconstruct lighting render composite evaluate pipeline)
set(core_MAY "")
set(capture_MAY core)
set(calib_MAY core)
set(reconstruct_MAY core)
set(lighting_MAY core reconstruct)
set(render_MAY core reconstruct lighting)
set(composite_MAY core)
set(evaluate_MAY core render composite)
set(pipeline_MAY core capture calib reconstruct lighting render composite evaluate)
# The apps translate; of the stages they see the headers that users of the library see, and the
# JSON tools for the files they write.
set(apps_MAY ${modules})
set(apps_private_MAY core/io/json.h)

# Kept in .cpp files and private headers, so that a change of library is not a change of API.
set(hidden_libraries
    "opencv2|Eigen|ceres|embree3|Imath|Imf|OpenEXR|nlohmann|assimp|tiny_gltf|tbb|libexif")

# Each module's public headers, as its own build file lists them.
set(public_headers "")
foreach(module IN LISTS modules)
  if(NOT EXISTS ${ROOT}/${module}/CMakeLists.txt)
    continue()
  endif()
  file(READ ${ROOT}/${module}/CMakeLists.txt build_file)
  if(build_file MATCHES "HEADERS([^)]*)SOURCES")
    string(REGEX MATCHALL "[a-z0-9_/]+\\.h" listed "${CMAKE_MATCH_1}")
    list(TRANSFORM listed PREPEND ${module}/)
    list(APPEND public_headers ${listed})
  endif()
endforeach()

set(wrong 0)
macro(complain)
  message(NOTICE "${ARGV}")
  math(EXPR wrong "${wrong} + 1")
endmacro()

set(checked 0)
foreach(module IN ITEMS ${modules} apps)
  file(GLOB_RECURSE files RELATIVE ${ROOT} ${ROOT}/${module}/*.h ${ROOT}/${module}/*.cpp)
  foreach(file IN LISTS files)
    math(EXPR checked "${checked} + 1")
    file(STRINGS ${ROOT}/${file} lines REGEX "^[ \t]*#[ \t]*include")
    foreach(line IN LISTS lines)
      if(line MATCHES "include[ \t]*\"(([a-z_]+)/[^\"]*)\"")
        set(header ${CMAKE_MATCH_1})
        set(target ${CMAKE_MATCH_2})
        if(NOT target STREQUAL module AND NOT target IN_LIST ${module}_MAY)
          complain("${file}: ${module} must not include ${target}: ${line}")
        elseif(module STREQUAL "apps" AND NOT target STREQUAL "apps"
               AND NOT header IN_LIST public_headers AND NOT header IN_LIST apps_private_MAY)
          complain("${file}: ${header} is private to ${target}")
        elseif(file IN_LIST public_headers AND NOT header IN_LIST public_headers)
          complain("${file}: is a public header, ${header} is not")
        endif()
      elseif(line MATCHES "include[ \t]*\"")
        complain("${file}: name the folder of the header, from the root: ${line}")
      elseif(file IN_LIST public_headers AND line MATCHES "include[ \t]*<(${hidden_libraries})")
        complain("${file}: is a public header; keep this library in a .cpp file: ${line}")
      endif()
    endforeach()
  endforeach()
endforeach()

if(checked EQUAL 0)
  message(FATAL_ERROR "no source found below '${ROOT}'")
elseif(wrong GREATER 0)
  message(FATAL_ERROR "${wrong} includes against the rules")
endif()
message(STATUS "${checked} sources include in the right direction")
