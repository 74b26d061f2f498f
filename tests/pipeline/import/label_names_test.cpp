// SPDX-License-Identifier: Apache-2.0

// Whose names the values of a label map get: those of a table, of the file, or, said with a word,
// those of a numbering that sizes and places of the organs do not speak against.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "pipeline/anatomy/label_table.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/import/volume/label_numbering.h"
#include "support/temporary_folder.h"
#include "three_boxes.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
using testing::TinyVolume;

enum Organ { none, spleen, kidney_right, kidney_left, liver, stomach, aorta, vertebra, fat, skin };

// A torso of ellipsoids of human size about the origin, RAS+ mm.
Organ organ_at(Point3 p) {
    const auto in = [&](double x, double y, double z, double a, double b, double c) {
        return std::pow((p.x - x) / a, 2) + std::pow((p.y - y) / b, 2) +
                   std::pow((p.z - z) / c, 2) <
               1;
    };
    if (std::pow(p.x + 14, 2) + std::pow(p.y + 25, 2) < 121) return aorta;
    if (std::abs(p.x) < 22 && std::abs(p.y + 62) < 20 && std::abs(p.z + 10) < 15) return vertebra;
    if (in(-50, 45, 20, 40, 28, 40)) return stomach;
    if (in(-62, -52, -20, 24, 22, 45)) return kidney_left;
    if (in(62, -52, -35, 24, 22, 45)) return kidney_right;
    if (in(-85, -20, 50, 28, 32, 45)) return spleen;
    if (in(70, 10, 40, 60, 50, 55)) return liver;
    if (std::pow(p.x / 146, 2) + std::pow(p.y / 96, 2) < 1) return fat;
    if (std::pow(p.x / 150, 2) + std::pow(p.y / 100, 2) < 1) return skin;
    return none;
}

TinyVolume torso(const std::map<Organ, int>& values) {
    return testing::sample({42, 32, 30}, Matrix3::diagonal({8, 8, 8}), Point3{-164, -124, -116},
                           [&](Point3 p) {
                               const auto found = values.find(organ_at(p));
                               return found == values.end() ? 0 : found->second;
                           });
}

const std::map<Organ, int> kTotal{{spleen, 1},  {kidney_right, 2}, {kidney_left, 3}, {liver, 5},
                                  {stomach, 6}, {vertebra, 31},    {aorta, 52}};
const std::map<Organ, int> kTotalV1{{spleen, 1},  {kidney_right, 2}, {kidney_left, 3}, {liver, 5},
                                    {stomach, 6}, {vertebra, 22},    {aorta, 7}};
const std::map<Organ, int> kAmos{{spleen, 1}, {kidney_right, 2}, {kidney_left, 3},
                                 {liver, 6},  {stomach, 7},      {aorta, 8}};

std::map<int, std::string> names_of(const Result<ImportedLabels>& imported) {
    std::map<int, std::string> names;
    if (!imported) {
        ADD_FAILURE() << std::string(imported.error().message());
        return names;
    }
    for (const Label& label : imported->labels.labels) names[label.source_value] = label.name;
    return names;
}

bool says(const Result<ImportedLabels>& imported, const std::string& words) {
    for (const std::string& warning : imported->report.warnings)
        if (warning.find(words) != std::string::npos) return true;
    return false;
}

double measure(const Result<ImportedLabels>& imported, const std::string& name) {
    for (const Measure& m : imported->report.measures)
        if (m.name == name) return m.value;
    return 0;
}

void expect_refused(const Result<ImportedLabels>& imported,
                    const std::string& what,
                    const std::string& advice) {
    ASSERT_FALSE(imported.has_value()) << what;
    const std::string message = imported.error().message();
    EXPECT_NE(message.find(what), std::string::npos) << message;
    EXPECT_NE(message.find(advice), std::string::npos) << message;
}

class LabelNames : public ::testing::Test {
  protected:
    std::string map(const std::map<Organ, int>& values, const std::string& name = "map.nii") {
        return folder.write(name, testing::nifti_bytes(torso(values)));
    }
    TemporaryFolder folder;
};

TEST_F(LabelNames, NumbersOfTotalSegmentatorCountWhereAnatomyAgrees) {
    const auto imported = import_label_map(map(kTotal));
    EXPECT_EQ(names_of(imported)[5], "liver");
    EXPECT_EQ(names_of(imported)[52], "aorta");
    EXPECT_TRUE(imported->report.warnings.empty());
    EXPECT_EQ(measure(imported, "assumed_names"), 7);  // said nevertheless
    ASSERT_FALSE(imported->report.notes.empty());
    EXPECT_EQ(imported->report.notes[0].name, "names");
}

TEST_F(LabelNames, NumbersOfOthersAreRefusedWithTheOptionThatReadsThem) {
    for (const auto& [values, key, liver_value] :
         {std::tuple{kTotalV1, "total_v1", 5}, {kAmos, "amos", 6}}) {
        const std::string path = map(values);
        expect_refused(import_label_map(path), "not numbered as in TotalSegmentator v2",
                       std::string("--names ") + key);
        ImportOptions options;
        options.names = key;
        const auto imported = import_label_map(path, options);
        EXPECT_EQ(names_of(imported)[liver_value], "liver");
        EXPECT_TRUE(imported->report.warnings.empty());
    }
    const std::map<Organ, int> body{{spleen, 1}, {kidney_right, 1}, {kidney_left, 1},
                                    {liver, 1},  {stomach, 1},      {vertebra, 1},
                                    {aorta, 1},  {fat, 1},          {skin, 1}};
    expect_refused(import_label_map(map(body)), "1 would be spleen of 1", "--names body");
    const std::map<Organ, int> tissues{{fat, 1},   {skin, 2},   {liver, 3},
                                       {aorta, 3}, {spleen, 3}, {stomach, 3}};
    expect_refused(import_label_map(map(tissues)), "1 would be spleen of", "--names tissue_types");
    // A numbering that is not known here.
    std::map<Organ, int> shuffled = kTotal;
    shuffled[liver] = 9;
    shuffled[aorta] = 64;
    expect_refused(import_label_map(map(shuffled)), "9 would be adrenal_gland_left of",
                   "give --table");
    ImportOptions none_named;
    none_named.names = "none";
    EXPECT_EQ(names_of(import_label_map(map(shuffled), none_named))[9], "label_9");
}

// Numbers 1, 2, 3 ... as any network gives them: sizes and places know better than the numbers.
TEST_F(LabelNames, NumbersOfANetworkAreRefusedWhereThreeNamesWouldBeExchanged) {
    const std::map<Organ, int> network{{liver, 1},       {spleen, 2}, {kidney_right, 3},
                                       {kidney_left, 4}, {aorta, 5},  {stomach, 7}};
    expect_refused(import_label_map(map(network)), "not numbered as in TotalSegmentator v2",
                   "give --table");
}

TEST_F(LabelNames, DatasetJsonBesideTheMapOrAboveItNamesItsValues) {
    const std::map<Organ, int> network{{liver, 1}, {spleen, 2}, {kidney_right, 3}, {aorta, 4}};
    const char* v2 =
        "{\"labels\":{\"background\":0,\"liver\":1,\"spleen\":2,\"kidney_right\":3,"
        "\"aorta\":4},\"channel_names\":{\"0\":\"CT\"}}";
    const char* v1 =
        "{\"labels\":{\"0\":\"background\",\"1\":\"liver\",\"2\":\"spleen\","
        "\"3\":\"kidney_right\",\"4\":\"aorta\"},\"modality\":{\"0\":\"CT\"}}";
    int n = 0;
    for (const char* text : {v2, v1})
        for (const char* place : {"/labelsTr/dataset.json", "/dataset.json"}) {
            const std::string in = "d" + std::to_string(n++);
            folder.write(in + place, text);
            const auto imported = import_label_map(map(network, in + "/labelsTr/case_001.nii"));
            EXPECT_EQ(names_of(imported)[1], "liver");
            EXPECT_EQ(names_of(imported)[4], "aorta");
            EXPECT_TRUE(imported->report.warnings.empty());
            EXPECT_EQ(imported->report.notes.back().name, "table");
        }
    folder.write("r/dataset.json", "{\"labels\":{\"background\":0,\"whole\":[1,2],\"tumour\":2}}");
    EXPECT_TRUE(says(import_label_map(map(kTotal, "r/case.nii")), "region of several values"));
}

TEST_F(LabelNames, LabelGroupsOfMitkNameTheValuesOfTheirLayers) {
    const auto with = [&](const std::string& groups) {
        return import_label_map(folder.write(
            "mitk.nrrd", testing::nrrd_bytes(ras_volume(),
                                             "modality:=org.mitk.multilabel.segmentation\n"
                                             "org.mitk.multilabel.segmentation.labelgroups:=" +
                                                 groups + "\n")));
    };
    const auto imported = with(
        "[{\"labels\":[{\"color\":{\"type\":\"ColorProperty\",\"value\":[1,0,0.5]},"
        "\"name\":\"stomach\",\"value\":1},{\"name\":\"colon\",\"value\":5}]}]");
    EXPECT_EQ(names_of(imported)[1], "stomach");
    EXPECT_EQ(names_of(imported)[5], "colon");
    EXPECT_EQ(imported->labels.labels[1].colour, (std::array<std::uint8_t, 3>{255, 0, 128}));
    for (const char* damaged : {"[{\"labels\":[{\"name\":1}]}]", "[{}]", "[1]", "{",
                                "[{\"labels\":["
                                "{\"name\":\"a\",\"value\":1e99}]}]"})
        expect_refused(with(damaged), "MITK's label groups", "table");
}

TEST_F(LabelNames, MirroredBodyIsReadWithAWarning) {
    TinyVolume volume = torso(kTotal);
    volume.columns(0, 0) *= -1;
    volume.origin.x *= -1;
    const auto imported = import_label_map(folder.write("m.nii", testing::nifti_bytes(volume)));
    EXPECT_EQ(names_of(imported)[5], "liver");
    EXPECT_TRUE(says(imported, "though 1 would be spleen to the right of 5, liver"));
}

TEST_F(LabelNames, NumberingsAreThoseOfTheirPrograms) {
    EXPECT_EQ(numberings().front().names.size(), 117u);
    const auto name = [](const char* key, int value) { return find_numbering(key)->name(value); };
    EXPECT_EQ(find_numbering("total_v1")->names.size(), 104u);
    EXPECT_EQ(name("total_v1", 22), "vertebrae_L1");
    EXPECT_EQ(name("total_v1", 41), "vertebrae_C1");
    EXPECT_EQ(name("total_v1", 58), "rib_left_1");
    EXPECT_EQ(name("total_v1", 81), "rib_right_12");
    EXPECT_EQ(name("total_v1", 92), "sacrum");
    EXPECT_EQ(name("total_v1", 104), "urinary_bladder");
    EXPECT_EQ(find_numbering("total_mr")->names.size(), 50u);
    EXPECT_EQ(name("total_mr", 23), "aorta");
    EXPECT_EQ(name("total_mr", 38), "hip_left");
    EXPECT_EQ(name("total_mr", 50), "brain");
    EXPECT_EQ(name("amos", 15), "prostate");
    EXPECT_EQ(name("btcv", 11), "pancreas");
    EXPECT_EQ(name("flare22", 13), "kidney_left");
    EXPECT_EQ(name("flare22", 14), "");
}

TEST_F(LabelNames, TableThatIsGivenWinsOverTheNamesOfTheFile) {
    ImportOptions options;
    options.table = folder.write("t.csv", "value,name\n1,first\n5,third\n");
    const std::string xml =
        "<CaretExtension><VolumeInformation Index=\"0\"><LabelTable><Label Key=\"1\">uterus</Label>"
        "<Label Key=\"2\">second</Label></LabelTable></VolumeInformation></CaretExtension>";
    const auto nifti =
        import_label_map(folder.write("a.nii", testing::nifti_bytes(ras_volume(), xml)), options);
    EXPECT_EQ(names_of(nifti)[1], "first");
    EXPECT_EQ(names_of(nifti)[2], "second");  // the file names what the table does not
    const auto nrrd = import_label_map(
        folder.write("a.seg.nrrd", testing::nrrd_bytes(ras_volume(),
                                                       "Segment0_Name:=uterus\n"
                                                       "Segment0_LabelValue:=1\n"
                                                       "Segment1_Name:=second\n"
                                                       "Segment1_LabelValue:=2\n")),
        options);
    EXPECT_EQ(names_of(nrrd)[1], "first");
    EXPECT_EQ(names_of(nrrd)[2], "second");
    EXPECT_EQ(names_of(nrrd)[5], "third");
}

TEST_F(LabelNames, SegmentsCountWhateverTheirNumbers) {
    for (const auto& [liver_number, spleen_number] :
         {std::pair{0, 1}, {1, 2}, {3, 7}, {10, 2}, {117, 1000}}) {
        const auto segment = [](int number, const char* name, int value) {
            const std::string prefix = "Segment" + std::to_string(number) + "_";
            return prefix + "Name:=" + name + "\n" + prefix +
                   "LabelValue:=" + std::to_string(value) + "\n" + prefix + "Layer:=0\n";
        };
        const auto imported = import_label_map(folder.write(
            "s.seg.nrrd",
            testing::nrrd_bytes(ras_volume(), segment(liver_number, "liver", 1) +
                                                  segment(spleen_number, "spleen", 5))));
        EXPECT_EQ(names_of(imported)[1], "liver");
        EXPECT_EQ(names_of(imported)[5], "spleen");
        // Not among the segments: no name of TotalSegmentator takes its place.
        EXPECT_EQ(names_of(imported)[2], "label_2");
        EXPECT_TRUE(says(imported, "no table names the values 2"));
    }
}

// Blanks between cells and within names: the whole name counts, and its side.
TEST_F(LabelNames, BlanksWithinNamesBelongToThem) {
    const std::string path = map(kTotal);
    for (const auto& [name, text] :
         {std::pair<const char*, const char*>{
              "colours.ctbl",
              "# Color table\n0 Nothing 0 0 0 0\n2 kidney right 1 2 3 255\n"
              "3 kidney left 1 2 4 255\n5 liver 1 2 5 255\n"},
          {"tabs.tsv", "2\tkidney right\n3\tkidney left\n5\tliver\n"},
          {"id.csv", "id,label\n2,kidney right\n3,kidney left\n5,liver\n"},
          {"index.csv", "label,index\n'kidney right',2\n'kidney left',3\n'liver',5\n"},
          {"dcmqi.json",
           "{\"segmentAttributes\":[[{\"labelID\":2,\"SegmentLabel\":\"kidney right\"},"
           "{\"labelID\":3,\"SegmentDescription\":\"kidney left\"}],"
           "[{\"labelID\":5,\"SegmentedPropertyTypeCodeSequence\":{\"CodeMeaning\":\"liver\"}}]]}"},
          {"heading.txt", "value name\n2 kidney right\n3 kidney left\n5 liver\n"},
          {"commas.csv", "sep=,\nvalue,name\n2,kidney, right\n3,kidney, left\n5,liver\n5,liver\n"},
          {"list.json",
           "[{\"id\":2,\"name\":\"kidney right\"},{\"id\":3,\"name\":\"kidney left\"},"
           "{\"id\":5,\"name\":\"liver\"}]"}}) {
        ImportOptions options;
        options.table = folder.write(name, text);
        const auto imported = import_label_map(path, options);
        EXPECT_EQ(names_of(imported)[2], "kidney right") << name;
        EXPECT_EQ(names_of(imported)[3], "kidney left") << name;
        EXPECT_EQ(names_of(imported)[5], "liver") << name;
    }
}

// -1 or 255 for the outside, or a name for it: only 0 is outside here.
TEST_F(LabelNames, BackgroundOfItsOwnNumberIsTheOutside) {
    std::map<Organ, int> values = kTotal;
    for (const int background : {255, 1}) {
        TinyVolume volume = torso(values);
        for (auto& voxel : volume.voxels)
            voxel = static_cast<std::uint8_t>(voxel == 0        ? background
                                              : background == 1 ? voxel + 1
                                                                : voxel);
        const std::string path = folder.write("map.nii", testing::nifti_bytes(volume));
        ImportOptions options;
        options.names = "none";
        const auto imported = import_label_map(path, options);
        EXPECT_EQ(names_of(imported).count(background), 0u);
        EXPECT_EQ(imported->labels.labels.size(), 8u);
        EXPECT_TRUE(says(imported, "value " + std::to_string(background) +
                                       " holds all corners of the map, and no voxel is 0"));
        // The advice: a name.
        options.table = folder.write("t.csv", std::to_string(background) + ",fat\n");
        EXPECT_EQ(names_of(import_label_map(path, options))[background], "fat");
        options.table = folder.write("t.csv", std::to_string(background) + ",Exterior\n");
        const auto named = import_label_map(path, options);
        EXPECT_EQ(names_of(named).count(background), 0u);
        EXPECT_TRUE(says(named, "('Exterior') is taken as the outside"));
    }
}

TEST_F(LabelNames, TablesOfOtherProgramsAreReadForWhatTheyAre) {
    const std::pair<const char*, const char*> tables[] = {
        {"itksnap.txt",
         "################################################\n# ITK-SnAP Label Description File\n"
         "# IDX   -R-  -G-  -B-  -A--  VIS MSH  LABEL\n"
         "    0     0    0    0        0  0  0    \"Clear Label\"\n"
         "    1   255    0    0        1  1  1    \"the spleen\"\n"
         "    2     0  255    0        1  1  1    \"kidney_right\"\n"
         "    5     0    0  255        1  1  1    \"liver\"\n"},
        {"slicer.ctbl",
         "# Color table file /tmp/a.ctbl\n# 3 values\n0 Background 0 0 0 0\n"
         "1 the_spleen 255 0 0 255\n2 kidney_right 0 255 0 255\n5 liver 0 0 255 255\n"},
        {"slicer.csv",
         "LabelValue,Name,Color_R,Color_G,Color_B,Color_A\n1,the spleen,255,0,0,255\n"
         "2,kidney_right,0,255,0,255\n5,liver,0,0,255,255\n"},
        {"FreeSurferColorLUT.txt",
         "#$Id: FreeSurferColorLUT.txt\n\n#No. Label Name:    R   G   B   A\n\n"
         "0   Unknown  0   0   0   0\n1   the-spleen  255 0 0 0\n2 kidney_right 0 255 0 0\n"
         "5 liver 0 0 255 0\n"},
        {"dataset.json",
         "{\"channel_names\": {\"0\": \"CT\"}, \"labels\": {\"background\": 0, \"the spleen\": 1, "
         "\"kidney_right\": 2, \"liver\": 5}, \"numTraining\": 3}"},
        {"old.json",
         "{\"name\": \"x\", \"labels\": {\"0\": \"background\", \"1\": \"the spleen\", "
         "\"2\": \"kidney_right\", \"5\": \"liver\"}}"},
        {"monai.json", "{\"the spleen\": 1, \"kidney_right\": 2, \"liver\": 5}"},
        {"list.json",
         "{\"labels\": [\"background\", \"the spleen\", \"kidney_right\", \"c\", \"d\", "
         "\"liver\"]}"},
    };
    const std::string path = folder.write("map.nii", testing::nifti_bytes(ras_volume()));
    for (const auto& [name, text] : tables) {
        ImportOptions options;
        options.table = folder.write(name, text);
        const auto imported = import_label_map(path, options);
        ASSERT_TRUE(imported.has_value()) << std::string(imported.error().message());
        std::string first = names_of(imported)[1];
        for (char& c : first)
            if (c == '_' || c == '-') c = ' ';
        EXPECT_EQ(first, "the spleen") << name;
        EXPECT_EQ(names_of(imported)[5], "liver") << name;
    }
    for (const char* text :
         {"{\"labels\": {\"tumour\": [1, 2]}}", "{}", "{\"labels\": {\"a\": \"b\"}}", "{", "[1]",
          "1,8638\n2,1224\n", "\"Segment\",\"Volume\"\nliver,3\n", ""}) {
        const auto table = parse_label_table(text, "t");
        ASSERT_FALSE(table.has_value()) << text;
        EXPECT_FALSE(std::string(table.error().expected).empty()) << text;
    }
}

TEST_F(LabelNames, FileBesideTheMapThatNamesNothingIsLeftOutWithAWord) {
    const std::string path = map(kTotal, "Segmentation.nii");
    for (const char* text : {"\"Segment\",\"Number of voxels [voxels] (1)\"\n\"liver\",8638\n",
                             "\n", "value,name\n1,a\n1,b\n",
                             "value,name\n1,Gr\xf6\xdf"
                             "e\n"}) {
        folder.write("Segmentation.csv", text);
        const auto imported = import_label_map(path);
        EXPECT_EQ(names_of(imported)[5], "liver");
        EXPECT_TRUE(says(imported, "left out")) << text;
        // Given by hand it is an error.
        ImportOptions options;
        options.table = folder / "Segmentation.csv";
        EXPECT_FALSE(import_label_map(path, options).has_value());
    }
}

TEST_F(LabelNames, TextThatIsNotUtf8IsNamedOrTurned) {
    const std::string path = folder.write("map.nii", testing::nifti_bytes(ras_volume()));
    ImportOptions options;
    options.table = folder.write("t.csv",
                                 "value,name\n1,spleen\n5,Leber gr\xf6\xdf"
                                 "e\n");
    expect_refused(import_label_map(path, options), "t.csv:3", "CSV UTF-8");
    // Saved as the error says, it is read.
    options.table = folder.write(
        "s.csv", "\xEF\xBB\xBF" + utf8_of_windows_1252("value,name\n1,spleen\n5,gr\xf6\xdf\n"));
    EXPECT_EQ(names_of(import_label_map(path, options))[5], "gr\xc3\xb6\xc3\x9f");
    options.table = folder.write("u.csv", std::string("\xff\xfev\0a\0", 6));
    expect_refused(import_label_map(path, options), "UTF-16", "CSV UTF-8");
    const auto segment = import_label_map(
        folder.write("s.seg.nrrd", testing::nrrd_bytes(ras_volume(),
                                                       "Segment0_Name:=Leb\xe9r \x80\n"
                                                       "Segment0_LabelValue:=5\n")));
    EXPECT_EQ(names_of(segment)[5], "Leb\xc3\xa9r \xe2\x82\xac");
    EXPECT_TRUE(says(segment, "Windows-1252"));
    TinyVolume mask = ras_volume();
    for (auto& voxel : mask.voxels) voxel = voxel == kLiver;
    folder.write(
        "masks/gr\xf6\xdf"
        "e.nii",
        testing::nifti_bytes(mask));
    const auto masks = import_label_map(folder / "masks");
    ASSERT_TRUE(masks.has_value());
    EXPECT_EQ(masks->labels.labels[1].name,
              "gr\xc3\xb6\xc3\x9f"
              "e");
    const auto extension = import_label_map(
        folder.write("x.nii", testing::nifti_bytes(ras_volume(),
                                                   "<LabelTable><Label Key=\"5\">gr\xf6\xdf"
                                                   "e</Label></LabelTable>")));
    EXPECT_EQ(names_of(extension)[5],
              "gr\xc3\xb6\xc3\x9f"
              "e");
    for (const char* good : {"", "a", "\xc3\xb6", "\xe2\x82\xac", "\xf0\x9f\x98\x80"})
        EXPECT_TRUE(is_utf8(good)) << good;
    for (const char* bad :
         {"\xf6", "a\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xe2\x82", "\x80"})
        EXPECT_FALSE(is_utf8(bad));
}

std::string mask_of(int value, bool turned = false) {
    return testing::nifti_bytes(testing::sample_in_order(
        {0, 1, 2}, {false, false, false}, kExtent, kSpacing, kCorner,
        [=](Point3 p) { return (shifted_body(p) == value) != turned ? 1 : 0; }));
}

std::vector<std::string> names_in(const Result<ImportedLabels>& imported) {
    std::vector<std::string> names;
    if (!imported) {
        ADD_FAILURE() << std::string(imported.error().message());
        return names;
    }
    for (std::size_t n = 1; n < imported->labels.labels.size(); ++n)
        names.push_back(imported->labels.labels[n].name);
    std::sort(names.begin(), names.end());
    return names;
}

TEST(MaskFolder, WhatAllMasksOfAFolderShareIsNoPartOfTheirNames) {
    const std::vector<std::string> organs{"kidney_right", "liver", "spleen"};
    const TemporaryFolder folder;
    int n = 0;
    for (const auto& [front, back] :
         {std::pair{"case_01_", ""}, std::pair{"", "_mask"}, std::pair{"s0004 - ", ".seg"}}) {
        const std::string in = "m" + std::to_string(n++) + "/";
        folder.write(in + front + "liver" + back + ".nii", mask_of(kLiver));
        folder.write(in + front + "spleen" + back + ".nii", mask_of(kSpleen));
        folder.write(in + front + "kidney_right" + back + ".nii", mask_of(kKidneyRight));
        EXPECT_EQ(names_in(import_label_map(folder / in)), organs) << front << back;
    }
    // What is known keeps its name, and what is shared but names nothing stays.
    folder.write("k/kidney_left.nii", mask_of(kLiver));
    folder.write("k/kidney_right.nii", mask_of(kKidneyRight));
    EXPECT_EQ(names_in(import_label_map(folder / "k")),
              (std::vector<std::string>{"kidney_left", "kidney_right"}));
}

// As converters of DICOM segmentations name them: by the value alone.
TEST(MaskFolder, MasksThatAreCalledByNumberTakeNamesFromATable) {
    const TemporaryFolder folder;
    ImportOptions options;
    options.table = folder.write("t.csv", "value,name\n1,spleen\n2,kidney_right\n5,liver\n");
    for (const char* front : {"", "seg-", "Segment_00", "label "}) {
        const std::string in = std::string("m") + front + "/";
        folder.write(in + front + "5.nii", mask_of(kLiver));
        folder.write(in + front + "1.nii", mask_of(kSpleen));
        folder.write(in + front + "2.nii", mask_of(kKidneyRight));
        const auto imported = import_label_map(folder / in, options);
        EXPECT_EQ(names_in(imported), (std::vector<std::string>{"kidney_right", "liver", "spleen"}))
            << front;
        EXPECT_EQ(names_of(imported)[5], "liver") << front;
    }
    // A table of other names and numbers is not left unused without a word.
    options.table = folder.write("other.csv", "value,name\n7,heart\n");
    const auto unused = import_label_map(folder / "mseg-", options);
    ASSERT_FALSE(unused);
    EXPECT_NE(unused.error().message().find("no row of the table"), std::string::npos);
}

TEST(MaskFolder, MasksThatCannotBeMeantAreToldOf) {
    const TemporaryFolder folder;
    for (const auto& [name, value] : {std::pair{"liver", kLiver}, std::pair{"spleen", kSpleen},
                                      std::pair{"kidney_right", kKidneyRight}})
        folder.write(std::string("in/") + name + ".nii", mask_of(value, true));
    const auto turned = import_label_map(folder / "in");
    ASSERT_TRUE(turned) << turned.error().message();
    EXPECT_NE(turned->report.warnings.back().find("nothing is left of them: "), std::string::npos)
        << turned->report.warnings.back();
    folder.write("bg/liver.nii", mask_of(kLiver));
    folder.write("bg/background.nii", mask_of(0));
    EXPECT_EQ(names_in(import_label_map(folder / "bg")), std::vector<std::string>{"liver"});
    // A file of 3D Slicer with one segment has its name inside.
    TinyVolume one = ras_volume();
    for (std::uint8_t& voxel : one.voxels) voxel = voxel == kLiver;
    folder.write("seg/1.seg.nrrd", testing::nrrd_bytes(one,
                                                       "Segment0_Name:=liver\n"
                                                       "Segment0_LabelValue:=1\n"
                                                       "Segment0_Layer:=0\n"));
    folder.write("seg/2.nii", mask_of(kSpleen));
    EXPECT_EQ(names_in(import_label_map(folder / "seg")), (std::vector<std::string>{"2", "liver"}));
}

TEST(SegmentNames, TwoSegmentsOfOneValueAreRefused) {
    const TemporaryFolder folder;
    std::string fields;
    for (int n = 0; n < 2; ++n) {
        const std::string key = "Segment" + std::to_string(n);
        fields += key + (n == 0 ? "_Name:=liver\n" : "_Name:=spleen\n") + key + "_LabelValue:=5\n" +
                  key + "_Layer:=0\n";
    }
    const std::string path = folder.write("a.seg.nrrd", testing::nrrd_bytes(ras_volume(), fields));
    const auto refused = import_label_map(path);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().what.find("value 5 has two names, 'liver' and 'spleen'"),
              std::string::npos)
        << refused.error().message();
    ImportOptions options;
    options.table = folder.write("t.csv", "1,spleen\n2,kidney_right\n5,liver\n");
    EXPECT_TRUE(import_label_map(path, options));
}

}  // namespace
}  // namespace sonocase::pipeline
