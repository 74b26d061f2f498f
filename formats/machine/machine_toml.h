// SPDX-License-Identifier: Apache-2.0

// Machines as text: the table [machine] of a TOML file, and those that are built in.
//
//     [machine]
//     base = "modern"          # keys that are left out come from it; the default is modern
//     name = "clinic"
//     [machine.grey]
//     level = 52
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/machine/machine.h"

namespace sonocase {

// `where` names the file in errors, which give the line, the key and its limits, and for an unknown
// key the nearest valid one. A number that is NaN or infinite is out of range.
Result<Machine> parse_machine(std::string_view toml, const std::string& where);

// Every key: parse_machine(machine_toml(m)) equals m to the last bit. `m` must lie within the
// limits of machine.h.
std::string machine_toml(const Machine& machine);

std::vector<std::string> machine_names();  // classic, modern, modern-linear
// Errors: an unknown name, with the nearest valid one.
Result<Machine> built_in_machine(std::string_view name);

}  // namespace sonocase
