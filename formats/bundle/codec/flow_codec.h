// SPDX-License-Identifier: Apache-2.0

// The chunk `flow` of a bundle: docs/format.md, part 2. For the .cpp files of formats/ only, and
// for the stage that makes a flow field and keeps it as the bundle will.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/flow/flow_field.h"

namespace sonocase::detail {

inline constexpr std::size_t kMaxFlowBytes = std::size_t{16} << 20;

// Centres are rounded to 1/1024 mm, directions to 1/32767, radii to 1/256 mm; a round vessel
// has one radius per node. flow_from_bytes(flow_bytes(f)) written again gives the same bytes.
std::vector<std::uint8_t> flow_bytes(const FlowField& field);

// Trusts nothing: every count is checked against the bytes before anything is allocated. Errors: a
// newer version, bytes that are missing or left over, a name, junction or number that makes no
// sense. where: names the file.
Result<FlowField> flow_from_bytes(std::span<const std::uint8_t> bytes, const std::string& where);

}  // namespace sonocase::detail
