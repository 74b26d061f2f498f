# SPDX-License-Identifier: Apache-2.0
# What every target of ours shares: warnings, sanitizers, reproducible floating point, and the
# include rule that keeps the dependency law.

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # Precompiled headers: the cache may use them although they bear times and macros. A shell with another language (LANG, LC_ALL)
  # finds the same objects; what the compiler warned of is then in the language that it was first said in.
  set(CMAKE_CXX_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env CCACHE_SLOPPINESS=pch_defines,time_macros,locale CCACHE_PCH_EXTSUM=1
      "${CCACHE_PROGRAM}")
  set(CMAKE_C_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env CCACHE_SLOPPINESS=locale "${CCACHE_PROGRAM}")
endif()
find_program(MOLD_PROGRAM mold)
if(MOLD_PROGRAM AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_link_options(-fuse-ld=mold)
endif()
add_link_options(-Wl,--as-needed)
# Each function by itself, so that the player leaves out those that it does not call (--gc-sections).
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG -ffunction-sections -fdata-sections")
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g1")
# Tests are compiled once and run once: what they call is optimised, they need not be. With sanitizers that halves the time
# that they take to compile and adds a twentieth to the time that they run.
set(SONOCASE_TEST_OPTIONS $<$<CONFIG:Release>:-O1> $<$<CONFIG:Debug>:-O0>)

# Interface target for our own code only, never for third-party code.
add_library(sonocase_options INTERFACE)
target_compile_options(sonocase_options INTERFACE
  -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion
  # GCC 12 is wrong about moved strings and variants (its bugs 105651 and 105329); the sanitizers see what it means to see.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds> $<$<CXX_COMPILER_ID:GNU>:-Wno-free-nonheap-object>
  $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow> $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overread>
  -pthread
  # What ccache needs in order to know a precompiled header again.
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<COMPILE_LANGUAGE:CXX>>:-fpch-preprocess>
  # One rounding per operation on every machine: the same inputs give the same bytes.
  -ffp-contract=off)
if(SONOCASE_SANITIZE)
  add_compile_options(-fsanitize=${SONOCASE_SANITIZE} -fno-omit-frame-pointer
                      -fno-sanitize-recover=undefined)
  if(SONOCASE_SANITIZE_OMITTED)
    add_compile_options(-fno-sanitize=${SONOCASE_SANITIZE_OMITTED})
  endif()
  add_link_options(-fsanitize=${SONOCASE_SANITIZE})
endif()
# Adds scripts/cmake/keep_modules.c to a program; that file says why. By a library of its own: a program with a source in C
# would ask for C headers precompiled as well.
function(sonocase_keep_modules program)
  if(NOT TARGET sonocase_kept_modules)
    add_library(sonocase_kept_modules OBJECT "${CMAKE_SOURCE_DIR}/scripts/cmake/keep_modules.c")
  endif()
  target_link_libraries(${program} PRIVATE sonocase_kept_modules)
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

# What a room that says SMALL is compiled with: for size where the rest is compiled for speed.
set(SONOCASE_SMALL_OPTIONS $<$<CONFIG:Release>:-Os>)

# How many sources of a room are compiled as one, so that what they include is parsed once for all of them, which takes about
# half the time. 1 while you work on one room: each is compiled by itself.
set(SONOCASE_BATCH 8 CACHE STRING "Sources of a room that are compiled together; 1: each by itself")

# sonocase_batch_room(TARGET): what TARGET compiles alike goes in batches. Left alone are sources with options of their own,
# those that say so (SKIP_UNITY_BUILD_INCLUSION), and those that Highway compiles several times. Called when the folder has said all.
function(sonocase_batch_room target)
  get_target_property(sources ${target} SOURCES)
  set(alike "")
  foreach(source IN LISTS sources)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}")
    cmake_path(IS_PREFIX CMAKE_BINARY_DIR "${source}" made)
    set(own "${made}")
    foreach(property COMPILE_OPTIONS COMPILE_DEFINITIONS SKIP_PRECOMPILE_HEADERS SKIP_UNITY_BUILD_INCLUSION)
      get_source_file_property(value "${source}" ${property})
      if(value)
        set(own TRUE)
      endif()
    endforeach()
    if(NOT own)
      file(STRINGS "${source}" several REGEX "hwy/foreach_target.h" LIMIT_COUNT 1)
    endif()
    if(NOT own AND NOT several)
      list(APPEND alike "${source}")
    endif()
  endforeach()
  # Of about the same size: 9 sources are two batches of 5 and 4.
  list(LENGTH alike count)
  if(count LESS 2)
    return()
  endif()
  math(EXPR batches "(${count} + ${SONOCASE_BATCH} - 1) / ${SONOCASE_BATCH}")
  math(EXPR size "(${count} + ${batches} - 1) / ${batches}")
  set_source_files_properties(${alike} PROPERTIES HEADER_FILE_ONLY ON)
  set(place 0)
  foreach(source IN LISTS alike)
    math(EXPR number "${place} / ${size}")
    math(EXPR place "${place} + 1")
    # Seen from the batch, so that the cache serves every clone.
    cmake_path(RELATIVE_PATH source BASE_DIRECTORY "${CMAKE_BINARY_DIR}/facts")
    string(APPEND text_${number} "#include \"${source}\"\n")
  endforeach()
  math(EXPR last "${batches} - 1")
  foreach(number RANGE ${last})
    set(batch "${CMAKE_BINARY_DIR}/facts/${target}_${number}.cpp")
    file(WRITE "${batch}.new" "${text_${number}}")
    file(COPY_FILE "${batch}.new" "${batch}" ONLY_IF_DIFFERENT)
    target_sources(${target} PRIVATE "${batch}")
    # GCC takes a source that is included for a header, whose types others could see.
    set_source_files_properties("${batch}" PROPERTIES COMPILE_OPTIONS -Wno-subobject-linkage)
  endforeach()
endfunction()
# sonocase_batched(TARGET): the same, when the present folder has said all.
function(sonocase_batched target)
  if(SONOCASE_BATCH GREATER 1)
    cmake_language(EVAL CODE "cmake_language(DEFER CALL sonocase_batch_room ${target})")  # its name now, the call later
  endif()
endfunction()

# sonocase_room(FOLDER [SMALL] [SOURCES ...] [PUBLIC ...] [PRIVATE ...]): the library of one folder; folder a/b becomes
# target a_b. SMALL: no frame waits for it, and it is compiled for size. PUBLIC and PRIVATE name what it links: other rooms
# by their folder, third-party libraries by target. A room sees only the headers of the rooms that it links, so the compiler
# enforces the dependency law and every arrow below it.
function(sonocase_room folder)
  cmake_parse_arguments(arg "SMALL" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
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
    set(headers sonocase_room_headers)
    set(size "")
    if(arg_SMALL)
      set(headers sonocase_small_headers)
      set(size ${SONOCASE_SMALL_OPTIONS})
    endif()
    if(NOT TARGET ${headers})
      add_library(${headers} STATIC)
      target_compile_options(${headers} PRIVATE ${size})
      sonocase_precompiled(${headers} ${sonocase_std_headers})
    endif()
    add_library(${name} STATIC ${arg_SOURCES})
    target_compile_options(${name} PRIVATE ${size})
    target_precompile_headers(${name} REUSE_FROM ${headers})
    sonocase_batched(${name})
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

# What nearly every source of ours includes of the standard library, parsed once. A source still includes all that it uses: the
# page's program, the fuzzers and clang-tidy compile without this.
# A source with options of its own skips it (SKIP_PRECOMPILE_HEADERS): GCC 12 may crash where the optimisation differs.
set(sonocase_std_headers <algorithm> <array> <atomic> <charconv> <chrono> <cmath> <complex> <cstddef> <cstdint> <cstring>
  <functional> <limits> <map> <memory> <mutex> <numbers> <numeric> <optional> <set> <span> <string> <string_view> <thread>
  <tuple> <unordered_map> <utility> <variant> <vector>)
# sonocase_precompiled(TARGET HEADER...): a target that only holds precompiled headers, for others to reuse.
function(sonocase_precompiled target)
  file(WRITE "${CMAKE_BINARY_DIR}/facts/${target}.cpp.new" "int main() { return 0; }\n")
  file(COPY_FILE "${CMAKE_BINARY_DIR}/facts/${target}.cpp.new" "${CMAKE_BINARY_DIR}/facts/${target}.cpp" ONLY_IF_DIFFERENT)
  target_sources(${target} PRIVATE "${CMAKE_BINARY_DIR}/facts/${target}.cpp")
  target_link_libraries(${target} PRIVATE sonocase_options)
  target_precompile_headers(${target} PRIVATE ${ARGN})
  # What ccache knows it by, since its bytes differ from one folder to the next: compiler, options and content.
  file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/${target}.dir/cmake_pch.hxx.gch.sum"
       "${CMAKE_CXX_COMPILER_VERSION} ${CMAKE_BUILD_TYPE} ${SONOCASE_SANITIZE} ${SONOCASE_SANITIZE_OMITTED} ${target} ${ARGN}\n")
endfunction()

# How many test sources of a program are compiled as one: what they include is parsed, and what they have in common instantiated,
# once for all of them. 1 while you work on one test: each is compiled by itself.
set(SONOCASE_TEST_BATCH 12 CACHE STRING "Test sources that are compiled together; 1: each by itself")

# sonocase_batch(PROGRAM SOURCE): SOURCE joins the batch of PROGRAM that is being filled. In it, its unnamed namespace stands in
# one that is named after the file, so that two files may use the same names.
function(sonocase_batch program source)
  cmake_path(RELATIVE_PATH source BASE_DIRECTORY "${CMAKE_SOURCE_DIR}/tests" OUTPUT_VARIABLE path)
  cmake_path(GET path PARENT_PATH folder)
  string(MAKE_C_IDENTIFIER "${path}" name)
  file(READ "${source}" text)
  # Headers beside the source, seen from tests/.
  string(REGEX REPLACE "\n#include \"([^\"/]+\\.h|\\.\\./[^\"]+)\"" "\n#include \"${folder}/\\1\"" text "${text}")
  string(REPLACE "\nnamespace {\n" "\nnamespace in_${name} { namespace {\n" text "${text}")
  string(REPLACE "\n}  // namespace\n" "\n} }  // namespace\n" text "${text}")
  # Seen from where the compiler runs, so that the cache serves every clone.
  cmake_path(RELATIVE_PATH source BASE_DIRECTORY "${CMAKE_BINARY_DIR}" OUTPUT_VARIABLE seen)
  get_target_property(count ${program} sonocase_batched)
  math(EXPR number "${count} / ${SONOCASE_TEST_BATCH}")
  math(EXPR place "${count} % ${SONOCASE_TEST_BATCH}")
  math(EXPR count "${count} + 1")
  set_property(TARGET ${program} PROPERTY sonocase_batched ${count})
  set_property(GLOBAL APPEND_STRING PROPERTY sonocase_batch_${program}_${number} "#line 1 \"${seen}\"\n${text}\n")
  if(place EQUAL 0)
    set(batch "${CMAKE_BINARY_DIR}/facts/${program}_${number}.cpp")
    if(NOT EXISTS "${batch}")
      file(WRITE "${batch}" "")
    endif()
    target_sources(${program} PRIVATE "${batch}")
    set_property(GLOBAL APPEND PROPERTY sonocase_batches ${program}_${number})
  endif()
endfunction()
# sonocase_write_batches(): after the last sonocase_test.
function(sonocase_write_batches)
  get_property(batches GLOBAL PROPERTY sonocase_batches)
  foreach(name IN LISTS batches)
    get_property(text GLOBAL PROPERTY sonocase_batch_${name})
    set(batch "${CMAKE_BINARY_DIR}/facts/${name}.cpp")
    file(WRITE "${batch}.new" "${text}")
    file(COPY_FILE "${batch}.new" "${batch}" ONLY_IF_DIFFERENT)
  endforeach()
endfunction()

# sonocase_test(NAME [COST SECONDS] SOURCES ... LIBRARIES ...): one ctest entry of GoogleTest; the greatest cost begins first, so
# that no long test is left to run alone at the end of a first run, which has no times of its own. Where the folder (or one above it) has set
# SONOCASE_TEST_PROGRAM, entries share that program, which links fewer times and starts each with the suites of its own
# sources; elsewhere NAME is a program of its own. SONOCASE_TEST_TARGET is set to the program.
function(sonocase_test name)
  cmake_parse_arguments(arg "" "COST" "SOURCES;LIBRARIES" ${ARGN})
  if(SONOCASE_TEST_PROGRAM)
    set(program ${SONOCASE_TEST_PROGRAM})
  else()
    set(program ${name})
  endif()
  if(NOT TARGET sonocase_test_headers)  # an executable, as the programs are: position-independent in the same way
    add_executable(sonocase_test_headers)
    target_link_libraries(sonocase_test_headers PRIVATE GTest::gtest)
    target_compile_options(sonocase_test_headers PRIVATE ${SONOCASE_TEST_OPTIONS})
    sonocase_precompiled(sonocase_test_headers <gtest/gtest.h> ${sonocase_std_headers})
  endif()
  if(NOT TARGET ${program})
    add_executable(${program})
    target_link_libraries(${program} PRIVATE sonocase_options sonocase_test_support GTest::gtest_main)
    target_compile_options(${program} PRIVATE ${SONOCASE_TEST_OPTIONS})
    target_precompile_headers(${program} REUSE_FROM sonocase_test_headers)
    set_target_properties(${program} PROPERTIES sonocase_batched 0)
    if(SONOCASE_SANITIZE MATCHES "address")
      sonocase_keep_modules(${program})
    endif()
  endif()
  list(TRANSFORM arg_SOURCES PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/" REGEX "^[^/]" OUTPUT_VARIABLE sources)
  get_property(present GLOBAL PROPERTY sonocase_sources_${program})
  list(LENGTH sources count)
  if(SONOCASE_TEST_PROGRAM OR count GREATER 1)
    set(batch ${SONOCASE_TEST_BATCH})
  else()
    set(batch 1)
  endif()
  foreach(source IN LISTS sources)
    if(source IN_LIST present)
      continue()
    endif()
    set_property(GLOBAL APPEND PROPERTY sonocase_sources_${program} "${source}")
    if(batch GREATER 1 AND source MATCHES "_test\\.cpp$")
      sonocase_batch(${program} "${source}")
    else()
      target_sources(${program} PRIVATE "${source}")
    endif()
  endforeach()
  target_link_libraries(${program} PRIVATE ${arg_LIBRARIES})
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${sources})
  set(filter "")
  if(SONOCASE_TEST_PROGRAM)
    set(suites "")
    foreach(source IN LISTS sources)
      file(STRINGS "${source}" lines REGEX "^(TEST|TEST_F|TEST_P|TYPED_TEST|RC_GTEST_PROP)\\(")
      list(TRANSFORM lines REPLACE "^[A-Z_]+\\( *([A-Za-z0-9_]+).*$" "\\1")
      list(APPEND suites ${lines})
    endforeach()
    list(REMOVE_DUPLICATES suites)
    foreach(suite IN LISTS suites)
      list(APPEND filter "${suite}.*" "${suite}/*" "*/${suite}.*")
    endforeach()
    list(JOIN filter ":" filter)
    set(filter "--gtest_filter=${filter}")
  endif()
  add_test(NAME ${name} COMMAND ${program} ${filter})
  if(arg_COST)
    set_tests_properties(${name} PROPERTIES COST ${arg_COST})
  endif()
  if(NOT TARGET ${name})
    add_custom_target(${name} DEPENDS ${program})
  endif()
  if(SONOCASE_SANITIZE MATCHES "address")
    set_tests_properties(${name} PROPERTIES ENVIRONMENT
      "LSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/support/leaks-of-libraries.txt:print_suppressions=0")
  endif()
  set(SONOCASE_TEST_TARGET ${program} PARENT_SCOPE)
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
