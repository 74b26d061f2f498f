// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/input_files.h"

#include <algorithm>
#include <filesystem>
#include <vector>

namespace sonocase::pipeline {

namespace fs = std::filesystem;

Result<std::string> digest_of_input(
    const std::string& path,
    const std::function<Result<std::string>(const std::string&)>& of_file) {
    std::error_code code;
    if (!fs::exists(path, code))
        return Error{"no such file or folder", path,
                     "check the path, or say with --data where the recipe's inputs are"};
    if (!fs::is_directory(path, code)) return of_file(path);
    std::vector<std::string> files;
    for (auto it = fs::recursive_directory_iterator(path, code);
         !code && it != fs::recursive_directory_iterator(); it.increment(code)) {
        std::error_code item_code;
        if (it->is_regular_file(item_code))
            files.push_back(fs::relative(it->path(), path, item_code).generic_string());
    }
    if (code)
        return Error{"cannot list the folder: " + code.message(), path,
                     "check that it may be read"};
    std::sort(files.begin(), files.end());
    Digest digest;
    for (const std::string& file : files) {
        auto one = of_file((fs::path(path) / file).string());
        if (!one) return one.error();
        digest.add(std::string_view(file)).add(std::string_view(*one));
    }
    return digest.hex();
}

Result<InputDigests> digest_inputs(const Recipe& recipe, const DigestOfInput& digest) {
    InputDigests inputs;
    const RecipeInputs& in = recipe.inputs;
    struct Item {
        const std::string& given;
        std::string& to;
    };
    for (const Item& item : {Item{in.labels, inputs.labels},
                             {in.label_table, inputs.label_table},
                             {in.surface, inputs.surface},
                             {in.examples, inputs.examples},
                             {in.landmarks, inputs.landmarks}}) {
        if (item.given.empty()) continue;
        auto hash = digest(recipe.resolve(item.given));
        if (!hash) return hash.error();
        item.to = *hash;
        inputs.files.push_back({item.given, std::move(*hash)});
    }
    return inputs;
}

}  // namespace sonocase::pipeline
