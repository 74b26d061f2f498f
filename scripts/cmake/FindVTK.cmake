# SPDX-License-Identifier: Apache-2.0
# VTK's headers and libraries, without VTK's own package files: those of Debian's libvtk9-dev ask for the development files of
# all that any part of VTK uses, and the package itself depends on a JDK, Qt, MySQL, GDAL, MPI, Tcl and Python, 200 packages and
# 815 MB that nothing here uses. scripts/install-packages therefore installs the libraries alone (libvtk9.1) and unpacks
# the headers; where libvtk9-dev is installed, its headers are taken.
#   find_package(VTK COMPONENTS ...)   defines VTK_VERSION and a target VTK::<component> for each
# Classes of other modules that the components' headers use come with every target; what is not used is not linked (--as-needed).
find_path(VTK_INCLUDE_DIR vtkVersionMacros.h PATHS "${SONOCASE_HEADERS}" PATH_SUFFIXES vtk-9.1)
set(vtk_libraries "")
foreach(module CommonColor CommonComputationalGeometry CommonCore CommonDataModel CommonExecutionModel CommonMath CommonMisc
        CommonSystem CommonTransforms sys ${VTK_FIND_COMPONENTS})
  find_library(VTK_${module}_LIBRARY NAMES vtk${module}-9.1 libvtk${module}-9.1.so.1)
  mark_as_advanced(VTK_${module}_LIBRARY)
  set(VTK_${module}_FOUND "${VTK_${module}_LIBRARY}")
  list(APPEND vtk_libraries "${VTK_${module}_LIBRARY}")
endforeach()
if(VTK_INCLUDE_DIR)
  sonocase_header_version(VTK_VERSION "${VTK_INCLUDE_DIR}/vtkVersionMacros.h" VTK_MAJOR_VERSION VTK_MINOR_VERSION
    VTK_BUILD_VERSION)
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(VTK REQUIRED_VARS VTK_CommonCore_LIBRARY VTK_INCLUDE_DIR VERSION_VAR VTK_VERSION HANDLE_COMPONENTS)
if(VTK_FOUND AND NOT TARGET vtk_common)
  list(FILTER vtk_libraries INCLUDE REGEX "vtk(Common|sys)")
  add_library(vtk_common INTERFACE IMPORTED)
  target_include_directories(vtk_common SYSTEM INTERFACE "${VTK_INCLUDE_DIR}")
  target_link_libraries(vtk_common INTERFACE ${vtk_libraries})
endif()
foreach(module IN LISTS VTK_FIND_COMPONENTS)
  if(VTK_FOUND AND NOT TARGET VTK::${module})
    add_library(VTK::${module} INTERFACE IMPORTED)
    target_link_libraries(VTK::${module} INTERFACE "${VTK_${module}_LIBRARY}" vtk_common)
  endif()
endforeach()
