// SPDX-License-Identifier: Apache-2.0

#pragma once

#include <string>

#include "formats/bundle/case_bundle.h"

namespace sonocase {

// What is to be shown with anything made from the case: who made its anatomy, and its licence.
// Empty: nothing.
std::string attribution_of(const CaseBundle& bundle);

}  // namespace sonocase
