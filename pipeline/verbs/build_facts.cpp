#include "pipeline/verbs/build_facts.h"

namespace sonocase::pipeline {

std::string producer() {
    return std::string("sonocase ") + SONOCASE_VERSION;
}

std::string build_facts(const char* program) {
    std::string facts = std::string(program) + " " + SONOCASE_VERSION + "\n";
    facts += std::string("commit    ") + SONOCASE_COMMIT + "\n";
    facts += std::string("compiler  ") + SONOCASE_COMPILER + "\n";
    facts += std::string("build     ") + SONOCASE_BUILD_TYPE + "\n";
    return facts;
}

}  // namespace sonocase::pipeline
