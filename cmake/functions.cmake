# insitu_module(<name> HEADERS <public>… SOURCES <private>… [PUBLIC_DEPS …] [PRIVATE_DEPS …])
function(insitu_module name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "HEADERS;SOURCES;PUBLIC_DEPS;PRIVATE_DEPS")
  list(TRANSFORM arg_HEADERS PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  add_library(insitu_${name} STATIC ${arg_SOURCES})
  add_library(insitu::${name} ALIAS insitu_${name})
  set_target_properties(insitu_${name} PROPERTIES EXPORT_NAME ${name})
  target_sources(insitu_${name} PUBLIC FILE_SET HEADERS
                 BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${arg_HEADERS})
  target_compile_features(insitu_${name} PUBLIC cxx_std_20)
  target_link_libraries(insitu_${name} PUBLIC ${arg_PUBLIC_DEPS}
                        PRIVATE ${arg_PRIVATE_DEPS} $<BUILD_INTERFACE:insitu_options>)
  install(TARGETS insitu_${name} EXPORT insituTargets
          FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/insitu)
endfunction()

# insitu_test(<folder>/<name> [LABELS …] [DEPS …]): tests/<folder>/<name>.cpp becomes one ctest.
# Label `reads-files` puts a test into the sanitizer run of .ci/run.
function(insitu_test path)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TIMEOUT" "LABELS;DEPS")
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 900)  # sanitizers on a busy machine take many times as long
  endif()
  get_filename_component(name ${path} NAME)
  get_filename_component(folder ${path} DIRECTORY)
  string(REPLACE "/" "_" folder "${folder}")
  set(target ${folder}_${name})
  add_executable(${target} ${PROJECT_SOURCE_DIR}/tests/${path}.cpp)
  target_link_libraries(${target} PRIVATE ${arg_DEPS} insitu_test_support GTest::gmock_main
                        insitu_options)
  add_test(NAME ${folder}.${name} COMMAND ${target})
  set_tests_properties(${folder}.${name} PROPERTIES LABELS "${arg_LABELS}" TIMEOUT ${arg_TIMEOUT})
  if("reads-files" IN_LIST arg_LABELS)
    add_dependencies(reads_file_tests ${target})
  endif()
endfunction()
