// SPDX-License-Identifier: Apache-2.0

// Steps of the class page: what the progress book of this machine says about everyone.
#pragma once

#include <string>

#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

// The records of the book, read when they are first asked for and after each change.
const ClassRecords& class_records(PlayerState& player);
// kind: "csv" or "xapi". Into the user's folder of data; a notice says where.
void save_class_file(PlayerState& player, const std::string& kind);
// Whose results set the pass mark by contrasting groups; kept in the settings.
bool is_expert(const Settings& settings, const std::string& trainee);
void toggle_expert(PlayerState& player, const std::string& trainee);
// Removes rows and recordings; a notice says what could not be removed.
void remove_from_class(PlayerState& player, const std::string& trainee);

}  // namespace sonocase::runtime::inline player_app
