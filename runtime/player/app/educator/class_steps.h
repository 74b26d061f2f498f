// SPDX-License-Identifier: Apache-2.0

// Steps of the class page: what the progress book of this machine says about everyone.
#pragma once

#include <string>

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

// Those of the book, read again when the page is opened; kept in app.view.
const ClassRecords& class_records(App& app);
// kind: "csv" or "xapi". Into the user's folder of data; a notice says where.
void save_class_file(App& app, const std::string& kind);
// Whose results set the pass mark by contrasting groups; kept in the settings.
bool is_expert(const App& app, const std::string& trainee);
void toggle_expert(App& app, const std::string& trainee);
// Removes rows and recordings; a notice says what could not be removed.
void remove_from_class(App& app, const std::string& trainee);

}  // namespace sonocase::runtime
