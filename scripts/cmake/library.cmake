# SPDX-License-Identifier: Apache-2.0
# The libraries for programs of others, and what installs them (component `development`); docs/library.md.
#
#   sonocase::core     bytes in, pixels and scores out: no file, no clock, no thread
#   sonocase::formats  core, and what touches files and threads: load and save, locks, the progress book
#
# Each is one file of the objects of its rooms, so that a consumer needs no order of rooms.
find_package(PkgConfig REQUIRED)
set(SONOCASE_CORE_API 1)
pkg_check_modules(ZSTD REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(SODIUM REQUIRED IMPORTED_TARGET libsodium)
pkg_check_modules(HWY REQUIRED IMPORTED_TARGET libhwy)
pkg_check_modules(SQLITE REQUIRED IMPORTED_TARGET sqlite3)
find_package(ZLIB REQUIRED)
find_package(Threads REQUIRED)
include(CMakePackageConfigHelpers)

string(CONCAT core_rooms "^(formats/(base|text|volume|flow|bundle|bundle/codec|pathology|exercise|machine|recording|calibration|scoring)|"
  "runtime/(imaging|imaging/.*|engine))$")
set(formats_rooms "^formats/(files|progress_book)$")
# Rooms whose headers a program may include, and headers of theirs that are for the room's neighbours alone.
string(CONCAT public_rooms "^(formats/(base|volume|flow|bundle|exercise|machine|recording|calibration|scoring|files|progress_book)|"
  "runtime/(imaging|imaging/core|imaging/truth|imaging/doppler|engine))$")
set(inner_headers "/(build_facts|event|whole_file|governor|image_formation|effect_table|noise|needle_chord|simd_target|plane_look_up|scan_convert|truth_inputs|truth_rows|[a-z_]*-inl)\\.h$")

set(version_headers "${CMAKE_BINARY_DIR}/include/version")
configure_file(scripts/cmake/version.h.in "${version_headers}/sonocase/version.h" @ONLY)
set(header_folder ${CMAKE_INSTALL_INCLUDEDIR}/sonocase)
install(FILES "${version_headers}/sonocase/version.h" DESTINATION ${header_folder}/sonocase COMPONENT development)

# sonocase_library(TARGET NAME PATTERN): libsonocase_NAME.a, exported as sonocase::NAME, of the rooms whose folders
# match PATTERN.
function(sonocase_library target name pattern)
  add_library(${target} STATIC)
  add_library(sonocase::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES
    LINKER_LANGUAGE CXX OUTPUT_NAME sonocase_${name} EXPORT_NAME ${name})
  target_compile_features(${target} INTERFACE cxx_std_20)
  target_include_directories(${target} INTERFACE
    "$<BUILD_INTERFACE:${version_headers}>" $<INSTALL_INTERFACE:${header_folder}>)
  get_property(rooms GLOBAL PROPERTY sonocase_rooms)
  list(FILTER rooms INCLUDE REGEX "${pattern}")
  foreach(room IN LISTS rooms)
    string(REPLACE "/" "_" room_target "${room}")
    get_target_property(type ${room_target} TYPE)
    if(NOT type STREQUAL "INTERFACE_LIBRARY")
      target_sources(${target} PRIVATE $<TARGET_OBJECTS:${room_target}>)
    endif()
    if(room MATCHES "${public_rooms}")
      target_include_directories(${target} INTERFACE
        "$<BUILD_INTERFACE:${CMAKE_BINARY_DIR}/include/${room_target}>")
      file(GLOB headers CONFIGURE_DEPENDS "${CMAKE_SOURCE_DIR}/${room}/*.h")
      list(FILTER headers EXCLUDE REGEX "${inner_headers}")
      install(FILES ${headers} DESTINATION ${header_folder}/${room} COMPONENT development)
    endif()
  endforeach()
  install(TARGETS ${target} EXPORT sonocase
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
endfunction()

sonocase_library(sonocase_core core "${core_rooms}")
target_link_libraries(sonocase_core PRIVATE PkgConfig::ZSTD PkgConfig::XXHASH PkgConfig::SODIUM PkgConfig::HWY ZLIB::ZLIB)
sonocase_library(sonocase_formats_library formats "${formats_rooms}")
target_link_libraries(sonocase_formats_library
  PUBLIC sonocase_core PRIVATE PkgConfig::SQLITE Threads::Threads)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/sonocase)
install(EXPORT sonocase NAMESPACE sonocase:: FILE sonocase-targets.cmake
        DESTINATION ${package_folder} COMPONENT development)
configure_package_config_file(scripts/cmake/sonocase-config.cmake.in
  "${CMAKE_BINARY_DIR}/package/sonocase-config.cmake" INSTALL_DESTINATION ${package_folder})
write_basic_package_version_file("${CMAKE_BINARY_DIR}/package/sonocase-config-version.cmake"
  COMPATIBILITY SameMinorVersion)
install(FILES "${CMAKE_BINARY_DIR}/package/sonocase-config.cmake"
              "${CMAKE_BINARY_DIR}/package/sonocase-config-version.cmake"
        DESTINATION ${package_folder} COMPONENT development)
