// SPDX-License-Identifier: Apache-2.0

// What a path leads to, checked before a library opens it: ITK, VTK and zlib would wait for ever on
// a pipe and read a device such as /dev/zero without end.
#pragma once

#include <string>

#include "formats/base/result.h"

namespace sonocase::pipeline {

// Done for a regular file with at least one byte; symbolic links are followed. Errors name what
// else the path leads to: nothing, a folder, a pipe, a device or a socket, an empty file.
// `expected` says what the caller reads, "expected a surface file".
Status check_source_file(const std::string& path, const std::string& expected);

// Done if the folder's own entries are files and folders only, so that a library that opens every
// entry comes to an end. Subfolders are not looked into.
Status check_source_folder(const std::string& folder, const std::string& expected);

}  // namespace sonocase::pipeline
