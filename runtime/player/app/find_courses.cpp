// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/find_courses.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "formats/files/atomic_file.h"
#include "runtime/player/app/case_cards.h"

namespace sonocase::runtime::inline player_app {

namespace fs = std::filesystem;

std::vector<Course> find_courses(const std::string& given, Notices& notices) {
    std::vector<fs::path> files;
    if (!given.empty()) files.emplace_back(given);
    for (fs::path& file : files_beside_cases("course.toml")) files.push_back(std::move(file));
    std::vector<Course> courses;
    for (const fs::path& file : files) {
        const auto text = read_text_file(file.string());
        auto course = text ? parse_course(*text, file.string()) : Result<Course>(text.error());
        if (!course) {
            notices.error(course.error().message());
            continue;
        }
        const bool known = std::any_of(courses.begin(), courses.end(),
                                       [&](const Course& c) { return c.name == course->name; });
        if (!known) courses.push_back(std::move(*course));
    }
    return courses;
}

}  // namespace sonocase::runtime::inline player_app
