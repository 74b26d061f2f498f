// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/landmark_file.h"

#include <cmath>

#include "formats/files/atomic_file.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline registration {

Result<std::vector<Landmark>> parse_landmarks(std::string_view csv, const std::string& where) {
    std::vector<Landmark> landmarks;
    bool first = true;
    for (const TextRow& row : split_rows(csv)) {
        const std::string at = where + ":" + std::to_string(row.line);
        const char* expected = "rows are name,ct_x,ct_y,ct_z,x,y,z in mm";
        if (row.cells.size() < 7) {
            return Error{"landmark row of " + std::to_string(row.cells.size()) + " cells", at,
                         expected};
        }
        double value[6];
        std::size_t numbers = 0;
        for (std::size_t c = 0; c < 6; ++c) {
            const std::optional<double> v = number_in(row.cells[c + 1]);
            if (v && std::isfinite(*v)) {
                value[c] = *v;
                ++numbers;
            }
        }
        if (numbers == 0 && first) {  // the header
            first = false;
            continue;
        }
        first = false;
        if (numbers < 6) {
            return Error{"landmark '" + row.cells[0] + "' has a coordinate that is not a number",
                         at, expected};
        }
        landmarks.push_back(
            {row.cells[0], {value[0], value[1], value[2]}, {value[3], value[4], value[5]}});
    }
    if (landmarks.empty()) {
        return Error{"no landmark found", where, "rows are name,ct_x,ct_y,ct_z,x,y,z in mm"};
    }
    return landmarks;
}

Result<std::vector<Landmark>> load_landmarks(const std::string& path) {
    SONOCASE_TRY(const std::string text, read_text_file(path));
    return parse_landmarks(text, path);
}

}  // namespace sonocase::pipeline::inline registration
