// SPDX-License-Identifier: Apache-2.0

#include <filesystem>
#include <map>
#include <memory>

#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/text/number_text.h"
#include "pipeline/base/program_beside.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/export/nrrd_file.h"
#include "pipeline/export/publish.h"
#include "pipeline/make/make_case.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/tradeoff/boundary_error.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {
namespace {

// A segmentation of the demo torso, as a segmenter writes it, and a folder to make cases in.
struct Study {
    TemporaryFolder folder;
    std::string labels;

    Status prepare() {
        if (!labels.empty()) return Done{};
        SONOCASE_TRY_DONE(folder.make("sonocase-make"));
        const std::string path = folder.path() + "/torso.seg.nrrd";
        SONOCASE_TRY_DONE(
            export_seg_nrrd(sample_analytic_torso(analytic_torso_grid({2, 2, 2})), path));
        labels = path;
        return Done{};
    }
};

// A case on the patient's own skin lies where the scan lies.
Registration nothing_moves() {
    Registration map = analytic_torso_truth();
    map.mannequin_from_ct = {};
    map.quadratic = QuadraticMap::from_rigid({}, {}, 1);
    map.residual = {};
    return map;
}

struct Made {
    double seconds = 0, again_s = 0;  // of processors
    double displaced_mm = 0;
    std::size_t exercises = 0;
    std::vector<std::uint8_t> bytes;
};

// `make` from the file to the checked case, with nothing in its cache.
Result<Made> make_once(Study& study, const Settings& settings) {
    SONOCASE_TRY_DONE(study.prepare());
    MakeOptions options;
    options.inputs = {study.labels};
    options.out = study.folder.path() + "/case.sonocase";
    options.producer = "tradeoff";
    for (const Setting& s : settings) options.sets.push_back(s.key + "=" + s.value);
    std::error_code code;
    std::filesystem::remove_all(study.folder.path() + "/case", code);
    std::filesystem::remove(options.out, code);
    const auto nobody = [](const Decision&) {};
    Made made;
    const double before = processor_seconds();
    SONOCASE_TRY(const auto first, make_case(options, nobody));
    const double between = processor_seconds();
    SONOCASE_TRY_DONE(make_case(options, nobody));
    made.again_s = processor_seconds() - between;
    made.seconds = between - before;
    made.exercises = first.exercises;
    SONOCASE_TRY(made.bytes, read_file(options.out));
    SONOCASE_TRY(const CaseBundle bundle, load_bundle(options.out));
    made.displaced_mm =
        measure_boundary_error({bundle.grid, dense_from_bricks(bundle.label_bricks), bundle.labels},
                               bundle.boundary, nothing_moves())
            .displaced_mm;
    return made;
}

Knob voxel_knob() {
    return {"resample.voxel_mm",
            {"4", "3", "2", "1.5", "1"},
            number_text(ResampleOptions{}.voxel_mm),
            "mm",
            "edge of the cooked voxels",
            "surfaces between voxels",
            "the map itself is of 2 mm: finer voxels hold nothing new",
            "hospital maps are finer than this one, and vessels need the finer voxels"};
}

}  // namespace

Suite make_suite() {
    auto study = std::make_shared<Study>();
    Suite suite;
    suite.name = "make";
    suite.title = "A case by `make`";
    suite.body = "demo-torso";
    suite.error_name = "mean displacement of surfaces";
    suite.error_unit = "mm";
    suite.truth =
        "A segmentation of the demo torso at 2 mm becomes a case on its own skin, with exercises, "
        "check and pictures, and is compared with the analytic anatomy at 200,000 random points. "
        "Seconds are processor seconds of the first run; the second run, which finds nothing to "
        "do, takes 0.06 s. Voxels of 4 mm take longer than voxels of 3 mm: needles fit less well "
        "between coarse voxels, so that `aim` tries 2,354 poses instead of 795 before it has its "
        "windows, and testing whether a needle would be visible takes most of that time.";
    suite.knobs = {voxel_knob()};
    suite.named = preset_points(built_in_stages());
    suite.measure = [study](const Settings& settings) -> Result<Measured> {
        SONOCASE_TRY(const Made made, make_once(*study, settings));
        return Measured{
            made.displaced_mm, made.seconds,
            text("%zu exercises; %.2f s the second time", made.exercises, made.again_s)};
    };
    return suite;
}

Suite publish_suite() {
    struct State {
        Study study;
        std::map<std::string, Made> made;  // by settings_text
    };
    auto state = std::make_shared<State>();
    Suite suite;
    suite.name = "publish";
    suite.title = "A published case";
    suite.body = "demo-torso";
    suite.error_name = "mean displacement of surfaces";
    suite.error_unit = "mm";
    suite.truth =
        "The case of the suite make is published on a site. Seconds are the time that a page waits "
        "on a line of 10 Mbit/s before the case can be opened: for its first parts and the list of "
        "its segments. The program itself, which a browser keeps, is not counted.";
    suite.knobs = {voxel_knob()};
    suite.named = preset_points(built_in_stages());
    suite.measure = [state](const Settings& settings) -> Result<Measured> {
        constexpr double kBytesPerSecond = 10e6 / 8;
        Made& made = state->made[settings_text(settings)];
        if (made.bytes.empty()) {
            SONOCASE_TRY(made, make_once(state->study, settings));
        }
        const double before = processor_seconds();
        SONOCASE_TRY(const ReadCase published, site_case(made.bytes, "case.sonocase"));
        const double publish_s = processor_seconds() - before;
        double first = static_cast<double>(segment_list(published.site).size());
        for (const ByteRange& range : published.site.first)
            first += static_cast<double>(range.count);
        return Measured{made.displaced_mm, first / kBytesPerSecond,
                        text("%.2f of %.2f MB; publishing takes %.2f s of processors", first / 1e6,
                             static_cast<double>(published.site.bytes) / 1e6, publish_s)};
    };
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
