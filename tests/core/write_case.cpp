// SPDX-License-Identifier: Apache-2.0

// core_write_case BUNDLE SESSION [flow|procedure|lesion|titled]: a small case (in whose vessel
// blood flows; with a second exercise that is a procedure, or has a cyst beside the vessel; with a
// title that is not its name), and a session of three seconds in which the probe slides over it and
// a needle goes in.
#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/recording/session.h"
#include "support/small_case.h"

namespace {

using namespace sonocase;

Session small_session() {
    Session session;
    session.header.case_name = "cylinder";
    session.header.exercise = "scan";
    const Matrix3 down = Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1});
    for (int n = 0; n < 60; ++n) {
        SessionSample sample;
        sample.time_s = 0.05 * n;
        sample.frame = n;
        sample.probe_ok = sample.needle_ok = true;
        sample.mannequin_from_probe = {down, {0, -30.0 + n, 60}};
        sample.mannequin_from_needle = {down, {0, 0, 75.0 - n}};
        sample.mannequin_from_drawn = sample.mannequin_from_needle;
        session.samples.push_back(sample);
    }
    return session;
}

bool write(const char* path, const std::vector<std::uint8_t>& bytes) {
    std::ofstream file(path, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    return static_cast<bool>(file.flush());
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3 && argc != 4) return 2;
    CaseBundle bundle = testing::small_case();
    const std::string_view with = argc == 4 ? argv[3] : "";
    if (with == "flow") testing::add_flow(bundle);
    if (with == "procedure") bundle.exercises.push_back({"line", testing::small_procedure_toml()});
    if (with == "lesion") {
        std::string toml = testing::small_exercise_toml();
        const auto put = [&](std::string_view from, std::string_view to) {
            toml.replace(toml.find(from), from.size(), to);
        };
        put("\"scan\"", "\"cyst\"");
        put("\"paper\"", "\"physical\"");
        put("centre = [0, 0, 25]", "centre = [22, 0, 30]\nlook = \"cyst\"");
        bundle.exercises.push_back({"cyst", toml});
    }
    if (with == "titled") bundle.manifest.recipe = "title = \"A vessel to find\"\n";
    const Sequence session = sequence_from_session(small_session());
    const bool good = write(argv[1], write_bundle(bundle)) &&
                      write(argv[2], write_sequence(session, SequenceForm::mha));
    return good ? 0 : 1;
}
