// SPDX-License-Identifier: Apache-2.0

// The bundles that the start page offers, and what it shows of each.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/message.h"

namespace sonocase::runtime::inline player_app {

struct BundleEntry {
    std::string path;
    std::string name;  // file name without its extension
    std::string folder;
    double megabytes = 0;
    bool recent = false;
};

// Where cases are looked for: the data folders of the user and the system, the current folder and
// its out/.
std::vector<std::filesystem::path> case_folders();
// The files there that are called `name`, or end in a point and it: "liver.course.toml".
std::vector<std::filesystem::path> files_beside_cases(const std::string& name);

// Those of `recent` that exist come first (bundles opened before, newest first), then those in
// case_folders().
std::vector<BundleEntry> find_bundles(const std::vector<std::string>& recent);

// Moves `path` to the front of `recent`, as an absolute path; at most kMaxRecent are kept.
inline constexpr std::size_t kMaxRecent = 12;
void remember_bundle(const std::string& path, std::vector<std::string>& recent);

// What the start page shows of each case: its name, its exercises and an ultrasound picture. Cases
// are opened one after the other on a thread of their own; the window takes what is ready.

struct CaseCard {
    struct Exercise {
        std::string name;
        std::vector<std::string> titles;  // # languages(), in the window's languages
        int mastery = 3;
        int difficulty = 1;
        struct Item {
            std::string name;
            std::vector<std::string> titles;  // as above
        };
        std::vector<Item> items;  // of its checklist
    };
    std::string path;
    std::string case_name;
    std::string title;  // of the recipe; the name where it has none
    std::vector<Exercise> exercises;
    Message fault;  // why it cannot be opened, a sentence; empty: it can
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

// In the language in use.
const std::string& title_of(const CaseCard::Exercise& exercise);
const std::string& title_of(const CaseCard::Exercise::Item& item);

// Opens a case and makes its card. Cost: opening it, and one picture.
CaseCard make_case_card(const std::string& path);

}  // namespace sonocase::runtime::inline player_app
