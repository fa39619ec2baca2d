# Fails when a source cites a work that docs/bibliography.md does not list.
# Use: cmake -D ROOT=<checkout> -P tests/check_bibliography.cmake
cmake_minimum_required(VERSION 3.25)

file(READ ${ROOT}/docs/bibliography.md bibliography)
set(missing "")
set(cited "")
foreach(module IN ITEMS core capture calib reconstruct lighting render composite evaluate pipeline
                        apps bench tests)
  file(GLOB_RECURSE files RELATIVE ${ROOT} ${ROOT}/${module}/*.h ${ROOT}/${module}/*.cpp)
  foreach(file IN LISTS files)
    # Brackets mean something to CMake lists: cut the keys out before they become list items.
    file(READ ${ROOT}/${file} text)
    string(REGEX MATCHALL "\\[[A-Z][A-Za-z]+[0-9][0-9]\\]" keys "${text}")
    string(REGEX MATCHALL "[A-Z][A-Za-z]+[0-9][0-9]" keys "${keys}")
    foreach(key IN LISTS keys)
      list(APPEND cited ${key})
      string(FIND "${bibliography}" "| [${key}] |" position)
      if(position EQUAL -1)
        message(NOTICE "${file}: cites [${key}], which docs/bibliography.md does not list")
        list(APPEND missing ${key})
      endif()
    endforeach()
  endforeach()
endforeach()

list(REMOVE_DUPLICATES cited)
list(LENGTH cited count)
if(missing)
  message(FATAL_ERROR "works are missing in docs/bibliography.md")
elseif(count EQUAL 0)
  message(FATAL_ERROR "no citation found below '${ROOT}'")
endif()
message(STATUS "${count} cited works are listed")
