// Whole files in, whole files out. An output appears under its name complete or not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/result.h"

namespace sonocase::pipeline {

Result<std::vector<std::uint8_t>> read_file(const std::string& path);
Result<std::string> read_text_file(const std::string& path);

// Writes a temporary name in the same folder and renames it; makes missing folders.
Status write_file(const std::string& path, std::span<const std::uint8_t> bytes);
Status write_text_file(const std::string& path, std::string_view text);

// Removes the temporaries of write_file that killed programs left in `folder` and below; their
// number. One in use holds a lock (flock), on whatever machine, and stays; where the file system
// knows no locks, one that was touched in the last hour counts as in use.
std::size_t remove_leftovers(const std::string& folder);

// For libraries that write files themselves: they write temporary(), which lies in the same folder
// with the same ending, and commit() renames it. Without commit() the temporary is removed.
class OutputFile {
  public:
    explicit OutputFile(std::string path);
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

}  // namespace sonocase::pipeline
