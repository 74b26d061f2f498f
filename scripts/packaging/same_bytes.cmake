# SPDX-License-Identifier: Apache-2.0
# Before a package is packed: every file of it gets the time of the commit (or SOURCE_DATE_EPOCH), so that the same commit
# gives the same package, whenever and wherever it is built. scripts/packaging/test-packages compares two builds. Outside a
# clone, and without SOURCE_DATE_EPOCH, files keep their own times.
if(NOT DEFINED ENV{SOURCE_DATE_EPOCH})
  execute_process(COMMAND git -C "${CMAKE_CURRENT_LIST_DIR}" log -1 --format=%ct OUTPUT_VARIABLE time
                  OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(NOT time)
    return()
  endif()
  set(ENV{SOURCE_DATE_EPOCH} ${time})
endif()
execute_process(COMMAND find "${CPACK_TEMPORARY_DIRECTORY}" -exec touch -h -d "@$ENV{SOURCE_DATE_EPOCH}" {} +
                COMMAND_ERROR_IS_FATAL ANY)
