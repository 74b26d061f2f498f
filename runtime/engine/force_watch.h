// SPDX-License-Identifier: Apache-2.0

// Notices a force sensor that cannot be trusted: a value that is not a number, one that jumps
// faster than a hand presses, one that never changes. What is not trusted leaves the last force as
// it was; a sensor that freezes while it is pressed is let go after a second, so that a picture
// does not stay pressed for ever.
#pragma once

namespace sonocase::runtime {

struct ForceWatchOptions {
    double most_n = 100;                          // more is a fault of the sensor
    double fastest_n_s = 400;                     // a hand's tap
    double frozen_after_s = 1;                    // no bit of a force above least_n changes
    double least_n = 0.2, least_change_n = 0.05;  // below it nothing needs to be worked out again
};

class ForceWatch {
  public:
    explicit ForceWatch(const ForceWatchOptions& options = {}) : options_(options) {}

    // With every reading; force_n negative: the tracker has no such sensor.
    void observe(double force_n, double time_s);
    bool present() const { return present_; }
    bool frozen() const { return frozen_; }
    double force_n() const { return force_n_; }  // trusted; 0 while frozen
    // The trusted force has changed since taken().
    bool fresh() const { return fresh_; }
    void taken() { fresh_ = false; }

  private:
    void trust(double force_n);

    ForceWatchOptions options_;
    bool present_ = false, frozen_ = false, fresh_ = false;
    double force_n_ = 0;
    double trusted_s_ = 0;                // of the last reading that was believed
    double last_n_ = -1, changed_s_ = 0;  // as it came
    double last_s_ = 0;
};

}  // namespace sonocase::runtime
