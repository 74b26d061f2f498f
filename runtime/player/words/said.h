// SPDX-License-Identifier: Apache-2.0

// What is put together before it reaches the window, in the language in use: sentences with names
// and numbers in them (notices, errors, messages of trackers), and names of tissue. Standard error
// keeps the English.
#pragma once

#include <string>

namespace sonocase::runtime {

// A sentence, or an Error's message: "where: what; expected". Looked for as a whole, then with the
// catalogue's %s standing for anything (which is looked for as well), then part by part. Parts that
// the catalogue lacks stay as they are.
std::string tr_said(const std::string& english);

// The name of a label as people write it: "kidney_left" is "Kidney left", "Niere links". Sides,
// numbers of ribs, vertebrae and lesions are put together from parts. A name that the catalogue
// lacks stays as it is.
std::string tissue_words(const std::string& label);

}  // namespace sonocase::runtime
