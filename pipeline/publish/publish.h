// SPDX-License-Identifier: Apache-2.0

// A site for browsers: page, program and cases in a folder that any static host serves, or one page
// with one case inside that opens from disk. docs/browser.md.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline {

struct PublishOptions {
    std::string program_folder;  // what scripts/web built; empty: looked for, see find_program()
    std::string xapi;            // address of a learning record store; empty: none
    std::string poses;           // origin of a pose server, ws://HOST:PORT; empty: none
    bool single_file = false;    // one .html; then there must be one case
};

struct Published {
    std::vector<std::string> files;     // written, as paths
    std::vector<std::string> warnings;  // whole sentences
};

// cases: paths of bundles. Each is read whole and checked; its name on the site is that of its
// file. site: a folder, or the .html of --single-file. Files are renamed into place one by one, the
// list of cases last, so that a site in use never names a file that is not there yet. Errors: a
// bundle that cannot be read, two of the same name, no program, an address that is not https, a
// file that cannot be written.
Result<Published> publish(const std::vector<std::string>& cases,
                          const std::string& site,
                          const PublishOptions& options = {});

// Folder with what scripts/web built: beside the installed program (../share/sonocase/web), or in
// the build tree of this one. Error: neither is there.
Result<std::string> find_program();

}  // namespace sonocase::pipeline
