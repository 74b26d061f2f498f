// SPDX-License-Identifier: Apache-2.0

// The history of all trainees: one row per session in an SQLite file on this machine. Nothing is
// sent anywhere. A trainee is a freely chosen name, and can be removed with everything that is
// stored under it.
//
// A room of its own, so that nothing else depends on a database.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/scoring/progress_entry.h"

namespace sonocase {

struct RemovedTrainee {
    std::size_t sessions = 0;    // of the book
    std::size_t recordings = 0;  // with their pictures and kept scores
    std::size_t reviews = 0;
    std::vector<std::string> not_deleted;  // files that could not be deleted
};

class ProgressBook {
  public:
    // Creates the file and its folder if they are missing. A book of an older version is brought to
    // version 4; sessions of version 1 get the seed 0, those before 4 count as practice. An Error
    // for a file that is not a progress book or was written by a newer program.
    static Result<ProgressBook> open(const std::string& path);
    ~ProgressBook();
    ProgressBook(ProgressBook&&) noexcept;
    ProgressBook& operator=(ProgressBook&&) noexcept;

    // One transaction: after a crash the session is stored with all its scores or not at all. A
    // session of the same trainee, case, exercise, start and recording is replaced; without a
    // recording every session is one of its own.
    Status add(const ProgressEntry& entry);
    // Oldest first. Empty names match all.
    Result<std::vector<ProgressEntry>> sessions(const std::string& trainee,
                                                const std::string& exercise) const;
    Result<std::vector<std::string>> trainees() const;
    // An answer to the same question replaces the one before.
    Status add(const CourseAnswer& answer);
    // In the order in which they were given; an empty name matches all.
    Result<std::vector<CourseAnswer>> answers(const std::string& trainee) const;
    // An Error, with the nearest name, where the book has neither sessions nor answers of this
    // trainee.
    Status expect_trainee(const std::string& trainee) const;
    // Removes the rows and the files of the recordings, and from the folder `sessions` beside the
    // book every recording whose header has this name, and the review pages of all of these.
    // Errors: nobody has the name.
    Result<RemovedTrainee> remove_trainee(const std::string& trainee);
    // One row per session, one column per score in the order of metric_table(); RFC 4180.
    Result<std::string> csv(const std::string& trainee, const std::string& exercise) const;

  private:
    struct Impl;
    explicit ProgressBook(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// The checklist of a score; empty where its exercise has no procedure.
std::vector<CheckedItem> checked_items(const SessionScore& score);
ProgressEntry progress_entry(const SessionHeader& header,
                             const SessionScore& score,
                             const std::string& recording);

// $XDG_DATA_HOME/sonocase (or ~/.local/share/sonocase)/progress.sqlite.
std::string default_progress_path();

}  // namespace sonocase
