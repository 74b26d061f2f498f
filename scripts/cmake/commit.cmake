# SPDX-License-Identifier: Apache-2.0
# Run at every build: writes the commit of SOURCE to FILE, and touches FILE only when that changed.
execute_process(COMMAND git describe --always --dirty --abbrev=12 --exclude=*
                WORKING_DIRECTORY "${SOURCE}" OUTPUT_VARIABLE commit
                OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT commit)
  set(commit "unknown")
endif()
file(CONFIGURE OUTPUT "${FILE}" CONTENT "#define SONOCASE_COMMIT \"${commit}\"\n")
