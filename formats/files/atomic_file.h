// SPDX-License-Identifier: Apache-2.0

// Reads and writes whole files. A file appears under its name complete or not at all.
// Separate from the parsers, which take bytes and therefore also run without a file system.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/memory.h"
#include "formats/base/result.h"

namespace sonocase {

// Each reads a whole file. An error when it does not exist, may not be read, or is not a regular
// file (see expect_regular_file).
Result<std::vector<std::uint8_t>> read_file(const std::string& path);
Result<RawVector<std::uint8_t>> read_large_file(const std::string& path);  // memory not cleared
Result<std::string> read_text_file(const std::string& path);

// An error, in one line, unless `path` leads to a regular file: a folder, a device (/dev/zero never
// ends), a pipe (opening one waits for its writer) or a socket. For readers that hand the path to a
// library. /dev/stdin is accepted when the shell connects it to a file.
Status expect_regular_file(const std::string& path,
                           const std::string& expected = "expected a file");

// Writes under a temporary name in the same folder, flushes to disk and renames over `path`;
// creates missing folders. On failure nothing is left behind and `path` keeps its old content.
// Devices, pipes and links to them (/dev/stdout) are appended to instead.
Status write_file(const std::string& path, std::span<const std::uint8_t> bytes);
Status write_file(const std::string& path, std::string_view text);

// An error where write_file would fail for want of rights, or where a folder has that name: to be
// asked before long work. Writes nothing.
Status expect_writable(const std::string& path);

// For libraries that write files themselves: they write temporary(), which is in the same folder
// and has the same ending, and commit() renames it. Without commit() the temporary is removed.
class OutputFile {
  public:
    explicit OutputFile(std::string path);  // makes missing folders
    ~OutputFile();
    OutputFile(const OutputFile&) = delete;
    OutputFile& operator=(const OutputFile&) = delete;

    const std::string& temporary() const { return temporary_; }
    Status commit();

  private:
    std::string path_;
    std::string temporary_;
    bool committed_ = false;
};

// Removes the temporary files of write_file that killed programs left in `folder` and below;
// returns their number. A file in use holds a lock (flock), on any machine, and stays; on a file
// system without locks, a file that was modified within the last hour counts as in use.
std::size_t remove_leftovers(const std::string& folder);

// The digest of a whole file (formats/base/digest.h).
Result<std::string> digest_of_file(const std::string& path);

}  // namespace sonocase
