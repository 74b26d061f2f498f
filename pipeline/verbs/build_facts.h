// What this program is and how it was built, for --version and for the producer of a bundle.
#pragma once

#include <string>

namespace sonocase::pipeline {

std::string build_facts(const char* program);  // lines for people
std::string producer();                        // "sonocase 0.1.0"

}  // namespace sonocase::pipeline
