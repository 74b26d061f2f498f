// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/quiet_library.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>

namespace sonocase::pipeline::inline base {

QuietLibrary::QuietLibrary() {
    std::fflush(stdout);
    std::fflush(stderr);
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (nowhere < 0) return;
    saved_out_ = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
    saved_error_ = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3);
    if (saved_out_ >= 0) dup2(nowhere, STDOUT_FILENO);
    if (saved_error_ >= 0) dup2(nowhere, STDERR_FILENO);
    close(nowhere);
}

QuietLibrary::~QuietLibrary() {
    std::fflush(stdout);
    std::fflush(stderr);
    if (saved_out_ >= 0) {
        dup2(saved_out_, STDOUT_FILENO);
        close(saved_out_);
    }
    if (saved_error_ >= 0) {
        dup2(saved_error_, STDERR_FILENO);
        close(saved_error_);
    }
}

}  // namespace sonocase::pipeline::inline base
