// SPDX-License-Identifier: Apache-2.0

#include "pipeline/make/make_case.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>

#include "../import/volume_files.h"
#include "formats/exercise/exercise.h"
#include "formats/exercise/exercise_texts.h"
#include "formats/files/load_save.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/check/check_case.h"
#include "pipeline/import/volume/label_map.h"
#include "support/paths.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;
using namespace sonocase::testing;

// The analytic torso as a segmenter sees it, 5 mm: names by value.
const LabelVolume& torso() {
    static const LabelVolume labels = sample_analytic_torso(analytic_torso_grid({5, 5, 5}));
    return labels;
}

TinyVolume tiny(const LabelVolume& labels) {
    TinyVolume volume;
    volume.size = labels.grid.size;
    volume.origin = labels.grid.origin_mm;
    for (int axis = 0; axis < 3; ++axis) volume.columns(axis, axis) = labels.grid.spacing_mm[axis];
    volume.voxels = labels.voxels;
    return volume;
}

std::vector<TinySegment> segments_of(const LabelVolume& labels,
                                     const std::function<bool(const std::string&)>& wanted) {
    std::vector<TinySegment> segments;
    for (std::size_t l = 1; l < labels.labels.size(); ++l)
        if (wanted(labels.labels[l].name))
            segments.push_back({static_cast<int>(segments.size()) + 1,
                                labels.labels[l].name,
                                {static_cast<int>(l)},
                                ""});
    return segments;
}

// What the scan of such a body holds.
std::int16_t hounsfield(const Label& label) {
    if (label.tissue == "outside") return -1000;
    if (label.tissue == "gas" || label.tissue == "lung") return -850;
    if (label.tissue == "fat") return -100;
    if (label.tissue == "bone") return 500;
    return 50;
}

// A study as a hospital hands it over: slices of a CT, and what somebody segmented on them.
struct Study {
    LabelVolume labels = torso();
    std::function<bool(const std::string& name)> drawn = [](const std::string&) { return true; };
    bool with_scan = true;
    std::string patient_of_labels = "1", patient_of_scan = "1";
    int offset = 0;       // of the scan's values
    double slide_mm = 0;  // from slice to slice of the scan: a tilted gantry

    void write(const TemporaryFolder& folder, const std::string& name) const {
        const TinyVolume volume = tiny(labels);
        DicomCounts counts;
        counts.is_signed = true;
        counts.person = patient_of_scan;
        counts.frame_of_reference = patient_of_scan == patient_of_labels ? "1.2.3.7" : "1.2.3.6";
        for (const std::uint8_t voxel : labels.voxels)
            counts.values.push_back(
                static_cast<std::int16_t>(hounsfield(labels.labels[voxel]) + offset));
        TinyVolume tilted = volume;
        tilted.columns(1, 2) = slide_mm;
        for (int k = 0; with_scan && k < volume.size.z; ++k)
            folder.write(name + "/ct/" + std::to_string(100 + k) + ".dcm",
                         dicom_slice(tilted, k, "1.2.3.5", counts));
        TinyObject object;
        object.kind = "BINARY";
        object.segments = segments_of(labels, drawn);
        object.patient = patient_of_labels;
        if (!object.segments.empty())
            folder.write(name + "/seg/seg.dcm", dicom_object(volume, object));
    }
};

bool is_organ(const std::string& name) {
    static const std::set<std::string> cover{"skin", "other_fat", "abdominal_wall", "visceral_fat",
                                             "gas_in_body"};
    return !cover.contains(name);
}

struct Outcome {
    std::optional<MadeCase> made;
    std::string sentence;  // where there is none
    std::vector<Decision> decisions;
    std::vector<std::string> warnings;  // where there is none

    bool decided(const std::string& words) const {
        return std::any_of(decisions.begin(), decisions.end(), [&](const Decision& d) {
            return d.what.find(words) != std::string::npos;
        });
    }
};

class MakeCase : public ::testing::Test {
  protected:
    Outcome make(const std::string& input,
                 const std::string& name = "case",
                 bool accept_faults = false) {
        MakeOptions options;
        options.accept_faults = accept_faults;
        options.inputs = {folder_ / input};
        options.out = folder_ / (name + ".sonocase");
        options.preset = "draft";
        // Coarse: what is tested is which parts are joined, not how well they cook.
        options.sets = {"resample.voxel_mm=5"};
        return run(options);
    }
    Outcome run(const MakeOptions& options) {
        Outcome outcome;
        auto made = make_case(
            options, [&](const Decision& decision) { outcome.decisions.push_back(decision); }, {},
            &outcome.warnings);
        if (made)
            outcome.made = std::move(*made);
        else
            outcome.sentence = made.error().message();
        return outcome;
    }
    // One sentence: no line break, what to do behind a semicolon.
    void expect_sentence(const Outcome& outcome, const std::string& words) {
        EXPECT_FALSE(outcome.made.has_value());
        EXPECT_EQ(outcome.sentence.find('\n'), std::string::npos) << outcome.sentence;
        EXPECT_NE(outcome.sentence.find(words), std::string::npos) << outcome.sentence;
        EXPECT_NE(outcome.sentence.find("; "), std::string::npos) << outcome.sentence;
    }

    TemporaryFolder folder_;
};

// Organs alone with their CT: the body is filled in, exercises are found, and nothing is done
// twice.
TEST_F(MakeCase, a_study_becomes_a_case_that_its_check_calls_good_and_a_second_run_does_nothing) {
    Study{.drawn = is_organ}.write(folder_, "disc");
    const Outcome first = make("disc");
    ASSERT_TRUE(first.made) << first.sentence;
    EXPECT_TRUE(first.made->faults.empty()) << first.made->faults.front();
    EXPECT_GE(first.made->exercises, 3u);
    EXPECT_TRUE(first.decided("DICOM segmentation seg.dcm"));
    EXPECT_TRUE(first.decided("own skin"));
    for (const Decision& d : first.decisions) EXPECT_FALSE(d.otherwise.empty()) << d.what;
    for (const char* file : {"case/case.toml", "case/liver-biopsy.toml", "case/check.html",
                             "case/pictures.png", "case.sonocase"})
        EXPECT_TRUE(fs::is_regular_file(folder_ / file)) << file;
    const auto bundle = load_bundle(folder_ / "case.sonocase");
    ASSERT_TRUE(bundle);
    // The place of the disc is nobody's business: it may hold a name.
    EXPECT_EQ(bundle->manifest.recipe.find(folder_.path()), std::string::npos);

    // The patient's own skin: nothing moves. Its smoothing and the coarse voxels move an edge by
    // one.
    Box3 skin;
    for (const Point3 p : bundle->mannequin_skin.points) skin.include(p);
    const Box3 body = body_box(torso());
    EXPECT_NEAR(skin.centre().x, body.centre().x, 5);
    EXPECT_NEAR(skin.centre().y, body.centre().y, 5);
    EXPECT_NEAR(skin.centre().z, body.centre().z, 5);
    // A trainee tells exercises by their titles, in each language.
    std::map<std::string, std::set<std::string>> titles;
    for (const EmbeddedExercise& embedded : bundle->exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        const auto texts = parse_exercise_texts(embedded.toml, embedded.name);
        ASSERT_TRUE(exercise && texts);
        EXPECT_TRUE(titles[""].insert(exercise->title).second) << exercise->title;
        for (const ExerciseTexts& in : *texts)
            EXPECT_TRUE(titles[in.language].insert(in.title).second) << in.title;
    }
    // Needles enter through skin, and not where the scan cuts the body above and below.
    const Box3 box = bundle->grid.bounds();
    for (const EmbeddedExercise& embedded : bundle->exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        ASSERT_TRUE(exercise) << exercise.error().message();
        for (const Sweep& sweep : exercise->sweeps)
            for (const SweepKey& key : sweep.keys)
                if (key.has_needle) {
                    EXPECT_GT(key.needle_tip.z, box.lower.z) << embedded.name;
                    EXPECT_LT(key.needle_tip.z, box.upper.z) << embedded.name;
                }
    }

    const auto written = fs::last_write_time(folder_ / "case.sonocase");
    const Outcome again = make("disc");
    ASSERT_TRUE(again.made) << again.sentence;
    EXPECT_TRUE(again.made->cooked.empty()) << again.made->cooked.front();
    EXPECT_FALSE(again.made->checked_anew);
    EXPECT_EQ(fs::last_write_time(folder_ / "case.sonocase"), written);

    // An exercise that the author changed stays, and only what holds it is made again.
    std::string mine = read_text(folder_ / "case/liver-biopsy.toml");
    mine.replace(mine.find("title = \""), 9, "title = \"My ");
    folder_.write("case/liver-biopsy.toml", mine);
    const Outcome changed = make("disc");
    ASSERT_TRUE(changed.made) << changed.sentence;
    EXPECT_EQ(changed.made->cooked, std::vector<std::string>{"pack"});
    EXPECT_TRUE(changed.made->checked_anew);
    EXPECT_EQ(read_text(folder_ / "case/liver-biopsy.toml"), mine);
}

TEST_F(MakeCase, a_folder_of_masks_beside_its_ct_is_what_totalsegmentator_leaves) {
    TinyVolume volume = tiny(torso());
    const auto mask = [&](std::size_t label) {
        TinyVolume one = volume;
        for (std::uint8_t& voxel : one.voxels) voxel = voxel == label ? 1 : 0;
        return nifti_bytes(one);
    };
    for (std::size_t l = 1; l < torso().labels.size(); ++l)
        if (is_organ(torso().labels[l].name))
            folder_.write("s1/segmentations/" + torso().labels[l].name + ".nii", mask(l));
    // Without its CT there is no skin, and it says so at once.
    expect_sentence(make("s1"), "organs alone");
}

// Nine wrong inputs.

TEST_F(MakeCase, another_body_a_mouse) {
    Study mouse;
    mouse.labels.grid.spacing_mm = 0.08 * mouse.labels.grid.spacing_mm;
    mouse.write(folder_, "disc");
    expect_sentence(make("disc"), "mm");
}

TEST_F(MakeCase, one_organ_with_its_ct_becomes_a_case_for_that_organ) {
    Study{.drawn = [](const std::string& name) { return name == "liver"; }}.write(folder_, "disc");
    const Outcome outcome = make("disc");
    ASSERT_TRUE(outcome.made) << outcome.sentence;
    EXPECT_TRUE(outcome.made->faults.empty()) << outcome.made->faults.front();
    EXPECT_TRUE(outcome.decided("no exercise kidney-access: there is no 'kidney_right'"));
}

TEST_F(MakeCase, an_organ_of_the_left_has_the_exercises_of_the_right) {
    Study{.drawn = [](const std::string& name) { return name == "kidney_left"; }}.write(folder_,
                                                                                        "disc");
    const Outcome outcome = make("disc", "case", true);  // the check misses the other organs
    ASSERT_TRUE(outcome.made) << outcome.sentence;
    EXPECT_TRUE(outcome.decided("no exercise kidney-access: there is no 'kidney_right'"));
    EXPECT_TRUE(outcome.decided("exercise kidney-access-left: target in 'kidney_left'"));
    const std::string toml = read_text(folder_ / "case/kidney-access-left.toml");
    const auto bundle = load_bundle(folder_ / "case.sonocase");
    ASSERT_TRUE(bundle);
    const auto& all = bundle->exercises;
    const auto embedded = std::find_if(
        all.begin(), all.end(), [](const auto& one) { return one.name == "kidney-access-left"; });
    ASSERT_NE(embedded, all.end());
    const auto exercise = parse_exercise(embedded->toml, embedded->name);
    ASSERT_TRUE(exercise) << exercise.error().message();
    EXPECT_EQ(exercise->name, "kidney-access-left");
    EXPECT_EQ(exercise->title, "Access to the lower calyx of the left kidney");
    for (const char* word : {"right kidney", "_right", "rechte", "liver", "Leber"})
        EXPECT_EQ(toml.find(word), std::string::npos) << word;
    EXPECT_NE(toml.find("bright"), std::string::npos) << "a part of another word";
}

TEST_F(MakeCase, a_head_alone) {
    Study head;
    for (Label& label : head.labels.labels)
        if (is_organ(label.name) && label.name != "outside")
            label.name = "brain_part_" + std::to_string(&label - head.labels.labels.data());
    head.write(folder_, "disc");
    expect_sentence(make("disc"), "none of the exercises fits this anatomy: there is no 'liver'");
}

TEST_F(MakeCase, an_mr_image_in_the_place_of_the_ct) {
    // What was segmented on the MR image belongs to it, and its air is not at -1000.
    Study{.drawn = is_organ, .offset = 1100}.write(folder_, "disc");
    expect_sentence(make("disc"), "Hounsfield");
}

TEST_F(MakeCase, an_empty_folder_and_an_empty_map) {
    fs::create_directories(folder_ / "disc");
    expect_sentence(make("disc"), "holds nothing that is known");
    TinyVolume empty = tiny(torso());
    std::fill(empty.voxels.begin(), empty.voxels.end(), std::uint8_t{0});
    folder_.write("empty/labels.nii", nifti_bytes(empty));
    expect_sentence(make("empty"), "holds no body");
}

TEST_F(MakeCase, half_a_body) {
    // Some organs only: places that are tried in vain take the longest.
    Study half{.drawn = [](const std::string& name) {
        return !is_organ(name) || name == "liver" || name == "kidney_right" || name == "spleen";
    }};
    const Grid& grid = half.labels.grid;
    for (std::size_t n = 0; n < half.labels.voxels.size(); ++n)
        if (static_cast<int>(n) % grid.size.x < grid.size.x / 2) half.labels.voxels[n] = 0;
    half.write(folder_, "disc");
    expect_sentence(make("disc"), "although its neighbours are there");
}

TEST_F(MakeCase, no_skin) {
    Study{.drawn = is_organ, .with_scan = false}.write(folder_, "disc");
    expect_sentence(make("disc"), "organs alone");
}

TEST_F(MakeCase, two_patients_in_a_folder) {
    Study{.patient_of_scan = "2"}.write(folder_, "disc");
    const Outcome outcome = make("disc");
    expect_sentence(outcome, "two patients, such as ct/100.dcm and seg/seg.dcm");
}

// A disc holds earlier examinations too, often with more slices than the one that was segmented.
TEST_F(MakeCase, an_earlier_examination_beside_the_one_that_was_segmented) {
    Study{.drawn = is_organ}.write(folder_, "disc");
    TinyVolume earlier = tiny(torso());
    earlier.size.z += 20;
    DicomCounts air;
    air.is_signed = true;
    air.person = "1";
    air.frame_of_reference = "1.2.3.99";
    air.values.assign(static_cast<std::size_t>(earlier.size.x) *
                          static_cast<std::size_t>(earlier.size.y) *
                          static_cast<std::size_t>(earlier.size.z),
                      -1000);
    earlier.voxels.resize(air.values.size());
    for (int k = 0; k < earlier.size.z; ++k)
        folder_.write("disc/before/" + std::to_string(100 + k) + ".dcm",
                      dicom_slice(earlier, k, "1.2.3.98", air));
    const Outcome outcome = make("disc");
    ASSERT_TRUE(outcome.made) << outcome.sentence;
    EXPECT_TRUE(outcome.made->faults.empty());
    const std::string slices = std::to_string(torso().grid.size.z) + " CT slices";
    EXPECT_TRUE(outcome.decided("scan: " + slices));
    EXPECT_TRUE(outcome.decided("left out: " + std::to_string(earlier.size.z) + " x CT"));

    // An earlier examination of another patient is refused all the same.
    air.person = "2";
    folder_.write("disc/before/100.dcm", dicom_slice(earlier, 0, "1.2.3.98", air));
    expect_sentence(make("disc"), "two patients, such as ct/100.dcm and before/100.dcm");
}

// What is written here lies behind links in the case's folder; the author knows his own paths.
TEST_F(MakeCase, a_lost_slice_is_named_where_it_lies) {
    Study{}.write(folder_, "disc");
    for (const char* name : {"disc/ct/120.dcm", "disc/ct/121.dcm"})
        std::filesystem::remove(folder_ / name);
    const Outcome outcome = make("disc");
    expect_sentence(outcome, "missing between");
    EXPECT_NE(outcome.sentence.find(folder_ / "disc/ct/1"), std::string::npos) << outcome.sentence;
}

// What `import` refuses without --resample-shear, `make` does and says.
TEST_F(MakeCase, slices_of_a_tilted_gantry_are_moved) {
    Study{.drawn = is_organ, .slide_mm = 0.1}.write(folder_, "disc");
    const Outcome outcome = make("disc", "case", true);
    EXPECT_TRUE(outcome.made) << outcome.sentence;
    EXPECT_TRUE(outcome.decided("slices of a tilted gantry (1.15 degrees)"));
    EXPECT_NE(read_text(folder_ / "case/case.toml").find("\nresample_shear = true\n"),
              std::string::npos);
}

TEST_F(MakeCase, names_of_another_language) {
    Study german;
    for (Label& label : german.labels.labels)
        if (is_organ(label.name) && label.name != "outside") label.name = "Organ " + label.name;
    german.drawn = [](const std::string& name) { return name.starts_with("Organ "); };
    german.write(folder_, "disc");
    const Outcome outcome = make("disc");
    expect_sentence(outcome, "unknown names: ");
    expect_sentence(outcome, "--table FILE");
    // The names as the segmentation has them, and not what the scan filled in beside them.
    const auto renamed =
        std::count_if(german.labels.labels.begin(), german.labels.labels.end(),
                      [](const Label& label) { return label.name.starts_with("Organ "); });
    EXPECT_NE(outcome.sentence.find(" and " + std::to_string(renamed - 4) + " more;"),
              std::string::npos)
        << renamed << ": " << outcome.sentence;
}

// As people write names: every exercise is there, and what was renamed is told.
TEST_F(MakeCase, names_in_other_letters_have_the_exercises_of_their_organs) {
    Study study;
    for (Label& label : study.labels.labels) {
        if (!is_organ(label.name) || label.name == "outside") continue;
        std::string& name = label.name;
        std::replace(name.begin(), name.end(), '_', ' ');
        if (name.ends_with(" right")) name = "right " + name.substr(0, name.size() - 6);
        name[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(name[0])));
    }
    study.drawn = [](const std::string& name) {
        return std::isupper(static_cast<unsigned char>(name[0])) != 0;
    };
    study.write(folder_, "Mustermann Erika");
    const Outcome outcome = make("Mustermann Erika", "case", true);
    ASSERT_TRUE(outcome.made) << outcome.sentence;
    EXPECT_TRUE(outcome.decided("names: '"));
    EXPECT_TRUE(outcome.decided("exercise liver-biopsy: target"));
    EXPECT_TRUE(outcome.decided("exercise kidney-access: target"));
    // Nobody's name is in the case or its page.
    for (const char* file : {"case.sonocase", "case/check.html"})
        EXPECT_EQ(read_text(folder_ / file).find("ustermann"), std::string::npos) << file;
    const auto bundle = load_bundle(folder_ / "case.sonocase");
    ASSERT_TRUE(bundle);
    EXPECT_EQ(bundle->manifest.recipe.find('#'), std::string::npos);
    for (const InputHash& input : bundle->manifest.inputs)
        EXPECT_EQ(input.path.find('/'), std::string::npos) << input.path;
}

TEST_F(MakeCase, is_refused_where_its_folder_and_an_input_lie_in_each_other) {
    Study{.drawn = is_organ}.write(folder_, "patient7");
    const auto refused = [&](const std::string& input, const std::string& name,
                             const std::string& words) {
        const Outcome outcome = make(input, name);
        expect_sentence(outcome, words);
        expect_sentence(outcome, "give -o elsewhere");
    };
    refused("patient7", "patient7", "is the input");
    refused("patient7/", "patient7", "is the input");
    refused("patient7", "patient7/case", "lies in the input");
    refused("patient7/ct", "patient7", "holds the input");
    refused("patient7/seg/seg.dcm", "patient7", "holds the input");
    EXPECT_FALSE(fs::exists(folder_ / "patient7/input"));
    EXPECT_FALSE(fs::exists(folder_ / "patient7/case"));
}

// What file managers and editors leave beside the recipe.
TEST_F(MakeCase, warnings_come_with_the_error_and_hidden_files_are_no_exercises) {
    Study phantom;
    for (Label& label : phantom.labels.labels)
        if (label.name != "outside")
            label.name = "tube_" + std::to_string(&label - phantom.labels.labels.data());
    phantom.write(folder_, "disc");
    folder_.write("case/._liver-biopsy.toml", std::string("\0\5\x16\7", 4));
    const Outcome outcome = make("disc");
    expect_sentence(outcome, "none of the exercises fits");
    ASSERT_FALSE(outcome.warnings.empty());
    EXPECT_TRUE(outcome.warnings[0].starts_with("import: ")) << outcome.warnings[0];
}

TEST_F(MakeCase, a_phantom) {
    Study phantom;
    for (Label& label : phantom.labels.labels)
        if (label.name != "outside")
            label.name = "tube_" + std::to_string(&label - phantom.labels.labels.data());
    phantom.write(folder_, "disc");
    expect_sentence(make("disc"), "none of the exercises fits");
}

}  // namespace
}  // namespace sonocase::pipeline
