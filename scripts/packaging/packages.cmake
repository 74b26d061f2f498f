# Two Debian packages: sonocase (the pipeline) and sonoplay (the player, which needs none of it).
#   cpack --config build/release/CPackConfig.cmake
set(share ${CMAKE_INSTALL_DATADIR})
set(packaging ${CMAKE_SOURCE_DIR}/scripts/packaging)

if(SONOCASE_RUNTIME)
  install(FILES ${packaging}/60-sonocase-trackers.rules
          DESTINATION ${CMAKE_INSTALL_PREFIX}/lib/udev/rules.d COMPONENT sonoplay)
  install(FILES ${packaging}/sonoplay.desktop DESTINATION ${share}/applications COMPONENT sonoplay)
  install(FILES ${packaging}/sonocase-mime.xml DESTINATION ${share}/mime/packages
          RENAME sonocase.xml COMPONENT sonoplay)
  install(FILES ${packaging}/sonoplay.svg DESTINATION ${share}/icons/hicolor/scalable/apps
          COMPONENT sonoplay)
  install(FILES ${packaging}/sonoplay.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT sonoplay)
  install(FILES ${packaging}/sonoplay.bash DESTINATION ${share}/bash-completion/completions
          RENAME sonoplay COMPONENT sonoplay)
endif()
if(SONOCASE_PIPELINE)
  install(FILES ${packaging}/sonocase.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT sonocase)
  install(FILES ${packaging}/sonocase.bash DESTINATION ${share}/bash-completion/completions
          RENAME sonocase COMPONENT sonocase)
  install(DIRECTORY ${CMAKE_SOURCE_DIR}/scenarios DESTINATION ${share}/sonocase COMPONENT sonocase)
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME sonocase)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "sonocase maintainers <maintainers@sonocase.invalid>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL "")
if(SONOCASE_PIPELINE)
  list(APPEND CPACK_COMPONENTS_ALL sonocase)
endif()
if(SONOCASE_RUNTIME)
  list(APPEND CPACK_COMPONENTS_ALL sonoplay)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_SONOCASE_PACKAGE_NAME sonocase)
set(CPACK_DEBIAN_SONOCASE_PACKAGE_SECTION science)
set(CPACK_DEBIAN_SONOPLAY_PACKAGE_NAME sonoplay)
set(CPACK_DEBIAN_SONOPLAY_PACKAGE_SECTION education)
set(CPACK_COMPONENT_SONOCASE_DESCRIPTION
    "Case bundles for ultrasound-guided needle placement training
 Turns a segmented CT and a digitised mannequin into a case bundle.")
set(CPACK_COMPONENT_SONOPLAY_DESCRIPTION
    "Trainer for ultrasound-guided needle placement
 Opens a case bundle, follows a tracked probe and needle, shows the ultrasound.")
include(CPack)
