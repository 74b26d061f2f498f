// SPDX-License-Identifier: Apache-2.0

// Silences libraries that print to standard output or standard error on bad input.
//
// Process-wide: while an object lives, file descriptors 1 and 2 are redirected to /dev/null, for
// every thread and every library. This is deliberate. ITK's and VTK's own messages could be caught
// by their output windows, but the C libraries below them (nifti, NrrdIO, GDCM, PNG) call
// fprintf directly and offer no hook; what they print would break the one-line error messages of
// the program, and they report the same failure by exception or return value as well.
//
// Use it only around the calls into such a library, on one thread, with nothing of ours printing
// meanwhile. Objects may be nested.
#pragma once

namespace sonocase::pipeline::inline base {

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

}  // namespace sonocase::pipeline::inline base
