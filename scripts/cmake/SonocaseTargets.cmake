# SPDX-License-Identifier: Apache-2.0
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

# Interface target for our own code only, never for third-party code.
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
# Adds scripts/cmake/keep_modules.c to a program; that file says why.
function(sonocase_keep_modules program)
  target_sources(${program} PRIVATE "${CMAKE_SOURCE_DIR}/scripts/cmake/keep_modules.c")
  target_link_options(${program} PRIVATE -Wl,--export-dynamic-symbol=dlclose)
endfunction()

# sonocase_doors(VARIABLE FOLDER): the include directory through which the headers of FOLDER alone are reached as
# "<FOLDER>/...".
function(sonocase_doors variable folder)
  string(REPLACE "/" "_" name "${folder}")
  set(doors "${CMAKE_BINARY_DIR}/include/${name}")
  file(MAKE_DIRECTORY "${doors}/${folder}")
  file(GLOB headers CONFIGURE_DEPENDS RELATIVE "${CMAKE_SOURCE_DIR}/${folder}" "${CMAKE_SOURCE_DIR}/${folder}/*.h"
       "${CMAKE_SOURCE_DIR}/${folder}/*.inc")
  file(GLOB links RELATIVE "${doors}/${folder}" "${doors}/${folder}/*.h" "${doors}/${folder}/*.inc")
  foreach(link IN LISTS links)
    if(NOT link IN_LIST headers)
      file(REMOVE "${doors}/${folder}/${link}")
    endif()
  endforeach()
  foreach(header IN LISTS headers)
    if(NOT EXISTS "${doors}/${folder}/${header}")  # a new link would compile all that includes it again
      file(CREATE_LINK "${CMAKE_SOURCE_DIR}/${folder}/${header}" "${doors}/${folder}/${header}" SYMBOLIC)
    endif()
  endforeach()
  set(${variable} "${doors}" PARENT_SCOPE)
endfunction()

# sonocase_room(FOLDER [SOURCES ...] [PUBLIC ...] [PRIVATE ...]): the library of one folder; folder a/b becomes
# target a_b. PUBLIC and PRIVATE name what it links: other rooms by their folder, third-party libraries by target. A
# room sees only the headers of the rooms that it links, so the compiler enforces the dependency law and every arrow
# below it.
function(sonocase_room folder)
  cmake_parse_arguments(arg "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  string(REPLACE "/" "_" name "${folder}")
  sonocase_doors(doors ${folder})
  foreach(scope PUBLIC PRIVATE)
    set(${scope}_targets "")
    foreach(target IN LISTS arg_${scope})
      if(target MATCHES "^(formats|pipeline|runtime)/")
        string(REPLACE "/" "_" target "${target}")
      endif()
      list(APPEND ${scope}_targets "${target}")
    endforeach()
  endforeach()
  if(arg_SOURCES)
    add_library(${name} STATIC ${arg_SOURCES})
    target_include_directories(${name} PUBLIC "$<BUILD_INTERFACE:${doors}>")
    target_link_libraries(${name} PUBLIC ${PUBLIC_targets} PRIVATE sonocase_options ${PRIVATE_targets})
  else()
    add_library(${name} INTERFACE)
    target_include_directories(${name} INTERFACE "$<BUILD_INTERFACE:${doors}>")
    target_link_libraries(${name} INTERFACE ${PUBLIC_targets})
  endif()
  set_property(GLOBAL APPEND PROPERTY sonocase_rooms ${folder})
  string(REGEX REPLACE "/.*" "" library "${folder}")
  target_link_libraries(sonocase_${library} INTERFACE ${name})
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

# sonocase_build_facts(PROGRAM LIBRARY...): gives PROGRAM the functions of formats/base/build_facts.h.
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

# sonocase_header_version(VARIABLE HEADER MACRO...): numbers that a header defines, joined by dots, for a library
# whose package file is broken in Debian.
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
