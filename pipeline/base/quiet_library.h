// SPDX-License-Identifier: Apache-2.0

// Keeps C libraries that print to standard output or error on bad input from doing so.
#pragma once

namespace sonocase::pipeline {

// While one lives, descriptors 1 and 2 lead nowhere. The import runs on one thread and prints
// nothing itself; what the libraries had to say comes back as an exception or a return value.
class QuietLibrary {
  public:
    QuietLibrary();
    ~QuietLibrary();
    QuietLibrary(const QuietLibrary&) = delete;
    QuietLibrary& operator=(const QuietLibrary&) = delete;

  private:
    int saved_out_ = -1;
    int saved_error_ = -1;
};

}  // namespace sonocase::pipeline
