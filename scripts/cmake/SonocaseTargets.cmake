# What every target of ours shares: warnings, sanitizers, reproducible floating point, and the
# include rule that keeps the dependency law.

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
  set(CMAKE_C_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
endif()
find_program(MOLD_PROGRAM mold)
if(MOLD_PROGRAM AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_link_options(-fuse-ld=mold)
endif()
add_link_options(-Wl,--as-needed)
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g1")

# Interface target that our own code links, and nothing of a third party's.
add_library(sonocase_options INTERFACE)
target_compile_options(sonocase_options INTERFACE
  -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion
  # One rounding per operation on every machine: the same inputs give the same bytes.
  -ffp-contract=off)
if(SONOCASE_SANITIZE)
  add_compile_options(-fsanitize=${SONOCASE_SANITIZE} -fno-omit-frame-pointer
                      -fno-sanitize-recover=undefined)
  add_link_options(-fsanitize=${SONOCASE_SANITIZE})
endif()
# Gives a program scripts/cmake/keep_modules.c, which says what for.
function(sonocase_keep_modules program)
  target_sources(${program} PRIVATE "${CMAKE_SOURCE_DIR}/scripts/cmake/keep_modules.c")
  target_link_options(${program} PRIVATE -Wl,--export-dynamic-symbol=dlclose)
endfunction()

# sonocase_library(NAME FOLDER): one of the three libraries. Its headers are reached as
# "<folder>/..." through a directory that holds a link to that folder alone, so that a target sees
# exactly the libraries it links: the runtime cannot include a pipeline header.
function(sonocase_library name folder)
  add_library(${name} STATIC)
  set(root "${CMAKE_BINARY_DIR}/include/${folder}")
  file(MAKE_DIRECTORY "${root}")
  file(CREATE_LINK "${CMAKE_SOURCE_DIR}/${folder}" "${root}/${folder}" SYMBOLIC)
  target_include_directories(${name} PUBLIC "${root}")
  target_link_libraries(${name} PRIVATE sonocase_options)
endfunction()

# sonocase_test(NAME SOURCES ... LIBRARIES ...): one GoogleTest program, one ctest entry.
function(sonocase_test name)
  cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE sonocase_options sonocase_test_support ${arg_LIBRARIES}
                        GTest::gtest_main)
  add_test(NAME ${name} COMMAND ${name})
  if(SONOCASE_SANITIZE MATCHES "address")
    sonocase_keep_modules(${name})
    set_tests_properties(${name} PROPERTIES ENVIRONMENT
      "LSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/support/leaks-of-libraries.txt:print_suppressions=0")
  endif()
endfunction()

# sonocase_uses(LIBRARY "NAME VERSION"...): what LIBRARY is built with, for --version.
function(sonocase_uses library)
  set_property(GLOBAL APPEND PROPERTY ${library}_uses ${ARGN})
endfunction()

# sonocase_build_facts(PROGRAM LIBRARY...): gives PROGRAM the functions of formats/build_facts.h.
add_custom_target(sonocase_commit
  COMMAND ${CMAKE_COMMAND} -DSOURCE=${CMAKE_SOURCE_DIR} -DFILE=${CMAKE_BINARY_DIR}/facts/commit.h
          -P ${CMAKE_SOURCE_DIR}/scripts/cmake/commit.cmake
  BYPRODUCTS ${CMAKE_BINARY_DIR}/facts/commit.h VERBATIM)
function(sonocase_build_facts program)
  set(libraries "")
  foreach(library IN LISTS ARGN)
    get_property(uses GLOBAL PROPERTY ${library}_uses)
    list(APPEND libraries ${uses})
  endforeach()
  list(REMOVE_DUPLICATES libraries)
  list(JOIN libraries ", " libraries)
  set(build "${CMAKE_BUILD_TYPE}")
  if(SONOCASE_SANITIZE)
    string(APPEND build ", sanitizers ${SONOCASE_SANITIZE}")
  endif()
  configure_file("${CMAKE_SOURCE_DIR}/scripts/cmake/build_facts.cpp.in"
                 "${CMAKE_BINARY_DIR}/facts/${program}.cpp" @ONLY)
  target_sources(${program} PRIVATE "${CMAKE_BINARY_DIR}/facts/${program}.cpp")
  target_include_directories(${program} PRIVATE "${CMAKE_BINARY_DIR}/facts")
  add_dependencies(${program} sonocase_commit)
  if(SONOCASE_SANITIZE MATCHES "address")
    sonocase_keep_modules(${program})
  endif()
endfunction()

# sonocase_header_version(VARIABLE HEADER MACRO...): numbers that a header defines, joined by dots, of a library
# whose package file Debian ships broken.
function(sonocase_header_version variable header)
  set(numbers "")
  foreach(macro IN LISTS ARGN)
    file(STRINGS "${header}" line REGEX "#define +${macro} +[0-9]+" LIMIT_COUNT 1)
    string(REGEX REPLACE ".*${macro} +([0-9]+).*" "\\1" number "${line}")
    list(APPEND numbers "${number}")
  endforeach()
  list(JOIN numbers "." numbers)
  set(${variable} "${numbers}" PARENT_SCOPE)
endfunction()
