// SPDX-License-Identifier: Apache-2.0

// Content hashes of a recipe's inputs, and a memory of them from run to run.
#pragma once

#include <functional>
#include <string>
#include <unordered_map>

#include "formats/base/digest.h"
#include "formats/base/result.h"
#include "formats/files/atomic_file.h"
#include "pipeline/stages/recipe.h"

namespace sonocase::pipeline::inline cook {

// Hashes a file's bytes, or the names and bytes of all files in a folder, at any depth.
// of_file  hashes one file
Result<std::string> digest_of_input(
    const std::string& path,
    const std::function<Result<std::string>(const std::string&)>& of_file = digest_of_file);

// digest  digest_of_input, or one that remembers. Error: a file that does not exist.
using DigestOfInput = std::function<Result<std::string>(const std::string& path)>;
Result<InputDigests> digest_inputs(const Recipe& recipe, const DigestOfInput& digest);

// Content hashes of files, remembered so that unchanged files are not read again.
//
// A file is known by path, inode, size, modification and change time, to the nanosecond. The change
// time is the system's own and moves with every write, also where a tool sets the modification time
// back. A file that was written less than ten seconds before it was hashed is not remembered, since
// another write might fall into the same tick of the file system's clock.
class DigestMemo {
  public:
    // Reads what save() wrote; a missing or unreadable file is an empty memo.
    explicit DigestMemo(std::string path);

    // Like digest_of_input.
    Result<std::string> digest(const std::string& path);
    // Writes the digests asked for since construction, if they differ from what the file holds.
    Status save() const;

  private:
    Result<std::string> of_file(const std::string& path);

    std::string path_;
    std::string saved_;                                     // the file's text
    std::unordered_map<std::string, std::string> known_;    // signature and path -> digest
    std::unordered_map<std::string, std::string> current_;  // those asked for
};

}  // namespace sonocase::pipeline::inline cook
