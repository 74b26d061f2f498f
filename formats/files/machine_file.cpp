// SPDX-License-Identifier: Apache-2.0

#include "formats/files/machine_file.h"

#include <string_view>

#include "formats/files/whole_file.h"
#include "formats/machine/machine_toml.h"

namespace sonocase {

Result<Machine> load_machine(const std::string& name_or_path) {
    const bool is_path = name_or_path.find('/') != std::string::npos ||
                         std::string_view(name_or_path).ends_with(".toml");
    if (!is_path) return built_in_machine(name_or_path);
    return detail::read_whole(name_or_path, [&](auto bytes) -> Result<Machine> {
        const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        return parse_machine(text, name_or_path);
    });
}

}  // namespace sonocase
