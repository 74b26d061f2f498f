// SPDX-License-Identifier: Apache-2.0

// sonocase check and sonocase aim; pipeline/command_line/verbs.h says how a verb is made.
#pragma once

namespace sonocase::pipeline {

int verb_aim(int argc, char** argv);
int verb_check(int argc, char** argv);

}  // namespace sonocase::pipeline
