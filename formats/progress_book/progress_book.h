// SPDX-License-Identifier: Apache-2.0

// What a trainee has done so far: one row a session in an SQLite file of this machine. Nothing is
// sent anywhere; a trainee is a name that somebody chose, and can be removed with all that is kept
// of it.
//
// A library of its own (sonocase_progress), so that the portable core does not carry a database.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/scoring/session_score.h"

namespace sonocase {

struct ProgressEntry {
    std::int64_t id = 0;                                // given by the book
    std::string trainee, case_name, exercise, started;  // started: ISO 8601, UTC
    std::string recording;                              // path of the session file; empty: not kept
    bool passed = false;
    std::vector<Metric> metrics;  // those that were defined
};

class ProgressBook {
  public:
    // Makes the file and its folder where they are missing. An Error for a file that is no progress
    // book or comes from a newer program.
    static Result<ProgressBook> open(const std::string& path);
    ~ProgressBook();
    ProgressBook(ProgressBook&&) noexcept;
    ProgressBook& operator=(ProgressBook&&) noexcept;

    // One transaction: after a crash the session is there with all its scores or not at all. A
    // session whose trainee, exercise and start are there already takes its place.
    Status add(const ProgressEntry& entry);
    // Oldest first. Empty names match all.
    Result<std::vector<ProgressEntry>> sessions(const std::string& trainee,
                                                const std::string& exercise) const;
    Result<std::vector<std::string>> trainees() const;
    // Rows, and the files of the recordings; `removed` names files that could not be deleted.
    Status remove_trainee(const std::string& trainee,
                          std::vector<std::string>* not_deleted = nullptr);
    // One row a session, one column a score: RFC 4180, the scores in the order of metric_table().
    Result<std::string> csv(const std::string& trainee, const std::string& exercise) const;

  private:
    struct Impl;
    explicit ProgressBook(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

ProgressEntry progress_entry(const SessionHeader& header,
                             const SessionScore& score,
                             const std::string& recording);

// $XDG_DATA_HOME/sonocase (or ~/.local/share/sonocase)/progress.sqlite.
std::string default_progress_path();

}  // namespace sonocase
