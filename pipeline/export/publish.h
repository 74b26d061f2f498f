// SPDX-License-Identifier: Apache-2.0

// A site for browsers: page, program and cases in a folder that any static host serves, or one page
// with one case inside that opens from disk. cases.json lists the cases (docs/browser.md). A site
// may hold a course, which is then also packed for learning platforms (course_package.h).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/arrivals.h"
#include "formats/base/result.h"
#include "formats/exercise/exercise_texts.h"

namespace sonocase::pipeline::inline exporting {

// A page fetches a case in runs of segments. Smaller segments fetch less that a picture does not
// need, but make the list of hashes longer.
inline constexpr std::size_t kSegmentBytes = std::size_t{4} << 10;

struct SiteCase {
    std::string name;       // in the address: letters, digits, - and _
    std::string title;      // shown: that of its recipe
    std::string case_name;  // in recordings and scores
    std::string file;       // "NAME-DIGITS.sonocase"; the name changes with the content
    std::uint64_t bytes = 0;
    std::string digest;                   // XXH3-128 of all bytes
    std::vector<std::uint64_t> segments;  // XXH3-64 of each kSegmentBytes, the last one shorter
    std::vector<ByteRange> first;         // needed before the case can be opened
    // PNG, may be empty: publish() puts the ultrasound at the start of the first exercise in place
    // of the slices that a bundle has.
    std::vector<std::uint8_t> preview;
    struct Entry {
        std::string name, title, description;
        int mastery = 3;                   // passes in a row
        std::vector<ExerciseTexts> texts;  // in other languages
        std::vector<std::string> sweeps;   // names; not on the site's list
    };
    std::vector<Entry> exercises;
};

struct ReadCase {
    SiteCase site;
    std::vector<std::uint8_t> bytes;  // of the site's file
};

// Prepares a bundle, whose path is given, for a site. The site's file has the same chunks, in the
// order in which a page loads them (arranged_for_loading()). Errors: bytes that are not a bundle.
Result<ReadCase> site_case(std::span<const std::uint8_t> bytes, const std::string& path);

// The hashes of the segments, little-endian, eight bytes each.
std::vector<std::uint8_t> segment_list(const SiteCase& site);

struct SiteFile {
    std::string name;  // in the site's folder
    std::vector<std::uint8_t> bytes;
};

// What cases.json says besides the cases; empty: nothing of it.
struct SiteNotes {
    std::string xapi, xapi_auth;  // learning record store, and the Authorization that it takes
    std::string course;           // the course's file
    std::string package;          // the kind of package that the site is part of
};
// The text of cases.json.
std::string site_list_json(const std::vector<SiteCase>& cases, const SiteNotes& notes);

struct PublishOptions {
    std::string program_folder;  // what scripts/web built; empty: looked for, see find_program()
    std::string xapi;            // address of a learning record store; empty: none
    // USER:SECRET or a whole Authorization of that store, which everyone who opens the site can
    // read; empty: none.
    std::string xapi_key;
    std::string poses;         // origin of a pose server, ws://HOST:PORT; empty: none
    bool single_file = false;  // one .html with exactly one case
    bool add = false;          // the cases that the site has already stay on it
    // A course (formats/exercise/course.h) that the site shows; all its cases have to be given.
    std::string course;
    std::vector<std::string> packages;  // of package_names(), written beside the site
};

struct Published {
    std::vector<std::string> files;     // written, as paths
    std::vector<std::string> warnings;  // whole sentences
};

// cases: paths of bundles. Each is read whole and checked; its name on the site is that of its
// file. site: a folder, or the .html of --single-file. Files are renamed into place one by one, the
// list of cases last, so that a site in use never names a file that is not there yet. Errors: a
// bundle that cannot be read, two of the same name, no program, an address that is not https, a
// folder with another page in it, a file that cannot be written; a course that cannot be read, or
// that needs a case, an exercise or an expert which is not among the cases given.
Result<Published> publish(const std::vector<std::string>& cases,
                          const std::string& site,
                          const PublishOptions& options = {});

// The folder with what scripts/web built: beside the installed program (../share/sonocase/web), or
// in the build tree of this one. Error: neither is there.
Result<std::string> find_program();

}  // namespace sonocase::pipeline::inline exporting
