# SPDX-License-Identifier: Apache-2.0
# Three Debian packages: sonocase (the pipeline, with recipes and documents), sonoplay (the player, which needs none of
# the pipeline's libraries) and python3-sonocase (the Python package, which needs neither).
#   cpack --config build/release/CPackConfig.cmake -B build/release/packages
# scripts/packaging/test-packages makes them, installs them in a clean Debian and runs them there.
set(share ${CMAKE_INSTALL_DATADIR})
set(packaging ${CMAKE_SOURCE_DIR}/scripts/packaging)
set(manuals ${CMAKE_BINARY_DIR}/manuals)

# install_manuals(PROGRAM): manual page and completion, made from its --help when it is installed.
function(install_manuals program)
  install(CODE "execute_process(COMMAND ${packaging}/manuals ${CMAKE_RUNTIME_OUTPUT_DIRECTORY} ${manuals} ${PROJECT_VERSION} ${program}
                                COMMAND_ERROR_IS_FATAL ANY)" COMPONENT ${program})
  install(FILES ${manuals}/${program}.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${program})
  install(FILES ${manuals}/${program}.bash DESTINATION ${share}/bash-completion/completions
          RENAME ${program} COMPONENT ${program})
  install(FILES ${packaging}/copyright DESTINATION ${share}/doc/${program} COMPONENT ${program})
endfunction()

# install_sbom(PACKAGE FILE COMPONENT [MODULE...]): every library that FILE and its MODULEs are made of, with version and licence (CycloneDX). Debian's
# packages are asked for both, so that elsewhere none is made.
function(install_sbom package file component)
  set(made ${CMAKE_BINARY_DIR}/sbom/${package}.cdx.json)
  find_program(DPKG_QUERY dpkg-query)
  if(DPKG_QUERY AND EXISTS /usr/bin/python3)
    install(CODE "execute_process(COMMAND ${packaging}/sbom ${file} ${made} ${PROJECT_VERSION} ${ARGN} COMMAND_ERROR_IS_FATAL ANY)"
            COMPONENT ${component})
    install(FILES ${made} DESTINATION ${share}/doc/${package} RENAME sbom.cdx.json COMPONENT ${component})
  endif()
endfunction()

if(SONOCASE_RUNTIME)
  install_manuals(sonoplay)
  install_sbom(sonoplay $<TARGET_FILE:sonoplay> sonoplay)
  install(FILES ${packaging}/60-sonocase-trackers.rules DESTINATION lib/udev/rules.d COMPONENT sonoplay)
  install(FILES ${packaging}/sonoplay.desktop DESTINATION ${share}/applications COMPONENT sonoplay)
  install(FILES ${packaging}/sonocase-mime.xml DESTINATION ${share}/mime/packages
          RENAME sonocase.xml COMPONENT sonoplay)
  install(FILES ${packaging}/sonoplay.svg DESTINATION ${share}/icons/hicolor/scalable/apps COMPONENT sonoplay)
  install(FILES ${packaging}/sonoplay.svg DESTINATION ${share}/icons/hicolor/scalable/mimetypes
          RENAME application-x-sonocase.svg COMPONENT sonoplay)
  install(FILES docs/training.md docs/metrics.md DESTINATION ${share}/doc/sonoplay COMPONENT sonoplay)
  install(DIRECTORY docs/pictures/training DESTINATION ${share}/doc/sonoplay/pictures COMPONENT sonoplay)
endif()
if(TARGET sonocase_python)
  install(FILES ${packaging}/copyright DESTINATION ${share}/doc/python3-sonocase COMPONENT python)
  install_sbom(python3-sonocase $<TARGET_FILE:sonocase_python> python)
  install(FILES docs/python.md DESTINATION ${share}/doc/python3-sonocase COMPONENT python)
endif()
if(SONOCASE_PIPELINE)
  install_manuals(sonocase)
  install_sbom(sonocase $<TARGET_FILE:sonocase> sonocase $<TARGET_FILE:sonocase_images>)
  install(DIRECTORY scenarios DESTINATION ${share}/sonocase COMPONENT sonocase)
  install(DIRECTORY docs/ DESTINATION ${share}/doc/sonocase COMPONENT sonocase)
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME sonocase)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "sonocase maintainers <maintainers@sonocase.invalid>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PRE_BUILD_SCRIPTS ${packaging}/same_bytes.cmake)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL "")
if(SONOCASE_PIPELINE)
  list(APPEND CPACK_COMPONENTS_ALL sonocase)
endif()
if(SONOCASE_RUNTIME)
  list(APPEND CPACK_COMPONENTS_ALL sonoplay)
endif()
if(TARGET sonocase_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
# The libraries that the programs link, found by dpkg-shlibdeps. What they open while they run is named here.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_SONOCASE_PACKAGE_NAME sonocase)
set(CPACK_DEBIAN_SONOCASE_PACKAGE_SECTION science)
set(CPACK_DEBIAN_SONOCASE_PACKAGE_RECOMMENDS "xvfb") # pictures of fits and sessions where there is no screen
set(CPACK_DEBIAN_SONOCASE_PACKAGE_SUGGESTS "sonoplay")
set(CPACK_DEBIAN_SONOPLAY_PACKAGE_NAME sonoplay)
set(CPACK_DEBIAN_SONOPLAY_PACKAGE_SECTION education)
set(CPACK_DEBIAN_SONOPLAY_PACKAGE_DEPENDS "libgl1, fonts-dejavu-core")
set(CPACK_DEBIAN_SONOPLAY_PACKAGE_RECOMMENDS "libgl1-mesa-dri, shared-mime-info, udev")
set(CPACK_DEBIAN_SONOPLAY_PACKAGE_SUGGESTS "sonocase")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-sonocase)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
# The module's file is named after the version of Python that it fits.
if(TARGET sonocase_python)
  math(EXPR next_python "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next_python}), python3-numpy")
endif()
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "sonoplay")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION
    "Ultrasound frames, labels and scores of case bundles in Python
Renders what a probe sees in a case bundle as NumPy arrays, with the label,
needle, shadow and depth of every pixel, and environments for learning.")
set(CPACK_COMPONENT_SONOCASE_DESCRIPTION
    "Case bundles for ultrasound-guided needle placement training
Turns a segmented CT and a digitised mannequin into a case bundle: fits the
patient to the mannequin, proves that the fit does not fold, learns textures
from real ultrasound, and says how good the result is.")
set(CPACK_COMPONENT_SONOPLAY_DESCRIPTION
    "Trainer for ultrasound-guided needle placement
Opens a case bundle, follows a tracked probe and needle, or the mouse, and
shows the ultrasound that the probe would see in a real patient.")
include(CPack)
