// SPDX-License-Identifier: Apache-2.0

// What the start page shows of each case: its name, its exercises and an ultrasound picture. Cases
// are opened one after the other on a thread of their own; the window takes what is ready.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace sonocase::runtime {

struct CaseCard {
    struct Exercise {
        std::string name, title;
        int mastery = 3;
        int difficulty = 1;
    };
    std::string path;
    std::string case_name;
    std::vector<Exercise> exercises;
    std::string fault;  // why it cannot be opened, a sentence; empty: it can
    // The picture at the start of the first exercise, grey, rows from the top; empty: none.
    int width_px = 0, height_px = 0;
    std::vector<std::uint8_t> pixels;
};

class CaseCards {
  public:
    CaseCards();
    ~CaseCards();  // waits for the case that is being opened
    CaseCards(const CaseCards&) = delete;
    CaseCards& operator=(const CaseCards&) = delete;

    // Reads those that are not known yet, in this order; a file that has changed is read again.
    void want(const std::vector<std::string>& paths);
    // The card of a path; null: not ready.
    std::shared_ptr<const CaseCard> find(const std::string& path) const;
    bool busy() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

// Opens a case and makes its card. Cost: opening it, and one picture.
CaseCard make_case_card(const std::string& path);

}  // namespace sonocase::runtime
