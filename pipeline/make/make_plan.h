// SPDX-License-Identifier: Apache-2.0

// What `make` is to make a case of, and the files that it keeps in the case's folder. Internal to
// pipeline/make.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/make/make_case.h"

namespace sonocase::pipeline::inline make {

using Decided = std::function<void(const Decision&)>;

// The given paths sorted out; empty: there is none.
struct FoundInputs {
    std::string labels, scan, table;
    bool resample_shear = false;
};
Result<FoundInputs> find_inputs(const MakeOptions& options, const Decided& decided);

// A case's folder, and what was written into it (made.json).
class CaseFolder {
  public:
    // out: path of the bundle. Errors: the folder cannot be made; its made.json is damaged.
    static Result<CaseFolder> open(const std::string& out);

    const std::string& path() const { return path_; }
    std::string file(const std::string& name) const { return path_ + "/" + name; }

    // The key under which something was made last; empty: never.
    std::string key(const std::string& of) const;
    void set_key(const std::string& of, const std::string& key) { keys_[of] = key; }

    // Writes a text that its reader may change; a file that somebody changed stays. Returns whether
    // the file holds the text.
    Result<bool> propose(const std::string& name, std::string_view text);
    // Removes files *.toml that were proposed before, are unchanged and no longer among `names`.
    Status withdraw_others(const std::vector<std::string>& names);
    // Files *.toml besides case.toml, by their stems: exercises, whoever wrote them.
    std::vector<std::string> exercises() const;

    // Links a given path into input/ under a plain name that keeps its ending. Returns the path for
    // the recipe. A file that has others beside it, such as .nhdr, keeps its own path.
    Result<std::string> link(const std::string& path, const std::string& name);
    // A path below a link in input/ as it was given, for a sentence; others as they are.
    std::string given(const std::string& path) const;

    Status save() const;

  private:
    std::string path_;
    std::map<std::string, std::string> keys_;      // what was made: its key
    std::map<std::string, std::string> proposed_;  // file name: digest of what was written
};

// The recipe of the inputs.
Result<std::string> recipe_text(const MakeOptions& options,
                                const FoundInputs& found,
                                CaseFolder& folder,
                                const Decided& decided);

}  // namespace sonocase::pipeline::inline make
