// SPDX-License-Identifier: Apache-2.0

// Where the voxels lie: every number of a header is read, checked and compared before it counts.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include <bzlib.h>

#include "pipeline/import/volume/label_map.h"
#include "support/temporary_folder.h"
#include "three_boxes.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
using testing::TinyVolume;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

template <class T>
void put(std::string& bytes, std::size_t at, T value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

// The table that names the boxes, so that nothing is said of names.
ImportOptions named(const TemporaryFolder& folder) {
    ImportOptions options;
    options.table = folder.write("names.csv", "1,spleen\n2,kidney_right\n5,liver\n");
    return options;
}

bool says(const Result<ImportedLabels>& imported, const std::string& words) {
    for (const std::string& warning : imported->report.warnings)
        if (warning.find(words) != std::string::npos) return true;
    return false;
}

// How many voxels carry another label than the body, moved, has at their place.
std::size_t wrong_voxels(const Result<ImportedLabels>& imported,
                         Vector3 moved = {},
                         double within_mm = 0) {
    if (!imported) {
        ADD_FAILURE() << std::string(imported.error().message());
        return 0;
    }
    const LabelVolume& labels = imported->labels;
    std::size_t n = 0, wrong = 0;
    for (int k = 0; k < labels.grid.size.z; ++k)
        for (int j = 0; j < labels.grid.size.y; ++j)
            for (int i = 0; i < labels.grid.size.x; ++i, ++n) {
                const Point3 p = labels.grid.point_from_voxel({double(i), double(j), double(k)});
                bool right = false;
                for (int corner = 0; corner < 27 && !right; ++corner) {
                    const Vector3 off{within_mm * (corner % 3 - 1),
                                      within_mm * (corner / 3 % 3 - 1),
                                      within_mm * (corner / 9 - 1)};
                    right = labels.labels[labels.voxels[n]].source_value ==
                            shifted_body(p - moved + off);
                }
                wrong += !right;
            }
    return wrong;
}

void expect_refused(const Result<ImportedLabels>& imported, const std::string& words) {
    ASSERT_FALSE(imported.has_value()) << words;
    const std::string message = imported.error().message();
    EXPECT_NE(message.find(words), std::string::npos) << message;
    EXPECT_EQ(message.find("vnl"), std::string::npos) << message;
    EXPECT_FALSE(imported.error().expected.empty()) << message;
}

TEST(VolumeGeometry, NumbersOfNiftiThatAreNotFiniteAreRefusedByTheirField) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    std::string good = testing::nifti_bytes(ras_volume());
    put(good, 252, std::int16_t{1});  // an identity as qform as well, at the same place
    for (int axis = 0; axis < 3; ++axis)
        put(good, 268 + 4 * axis, static_cast<float>(ras_volume().origin[axis]));
    ASSERT_TRUE(import_label_map(folder.write("good.nii", good), options).has_value());
    const std::pair<std::size_t, const char*> fields[] = {
        {80, "pixdim[1]"},  {84, "pixdim[2]"},  {88, "pixdim[3]"},  {108, "vox_offset"},
        {256, "quatern_b"}, {264, "quatern_d"}, {268, "qoffset_x"}, {276, "qoffset_z"},
        {280, "srow_x"},    {292, "srow_x"},    {300, "srow_y"},    {324, "srow_z"},
    };
    for (const auto& [at, field] : fields)
        for (const float value : {kNaN, kInf, -kInf})
            for (const char* name : {"a.nii", "a.nii.gz"}) {
                std::string bytes = good;
                put(bytes, at, value);
                expect_refused(
                    import_label_map(
                        folder.write(name, name[5] == '\0' ? bytes : testing::gzip_bytes(bytes)),
                        options),
                    field);
            }
    // What no code asks for is not read.
    std::string unused = good;
    put(unused, 252, std::int16_t{0});
    put(unused, 268, kNaN);
    EXPECT_EQ(wrong_voxels(import_label_map(folder.write("u.nii", unused), options)), 0u);
}

TEST(VolumeGeometry, VoxelSizesOfNiftiThatAreNoSizesAreRefusedOrTold) {
    const TemporaryFolder folder;
    ImportOptions options = named(folder);
    for (const float size : {0.0f, -2.0f}) {
        std::string bytes = testing::nifti_bytes(ras_volume());
        put(bytes, 80, size);
        const auto by_sform = import_label_map(folder.write("a.nii", bytes), options);
        EXPECT_EQ(wrong_voxels(by_sform), 0u);  // the sform has them
        EXPECT_TRUE(says(by_sform, "pixdim[1]"));
        put(bytes, 252, std::int16_t{1});
        put(bytes, 254, std::int16_t{0});
        expect_refused(import_label_map(folder.write("a.nii", bytes), options), "pixdim[1]");
    }
    std::string other = testing::nifti_bytes(ras_volume());
    put(other, 84, 5.0f);  // the sform has 4
    const auto imported = import_label_map(folder.write("o.nii", other), options);
    EXPECT_EQ(wrong_voxels(imported), 0u);
    EXPECT_TRUE(says(imported, "4 mm along axis 2 by the sform and 5 by pixdim"));
    for (const int size : {0, -48}) {
        std::string bytes = testing::nifti_bytes(ras_volume());
        put(bytes, 42, static_cast<std::int16_t>(size));
        expect_refused(import_label_map(folder.write("d.nii", bytes), options), "dim");
    }
}

TEST(VolumeGeometry, SformIsTakenWhereItAndTheQformDisagreeAndTheWordIsGiven) {
    const TemporaryFolder folder;
    ImportOptions options = named(folder);
    for (const int sform_code : {1, 2, 4}) {
        for (const bool mirrored : {false, true}) {
            std::string bytes = testing::nifti_bytes(ras_volume());
            put(bytes, 252, std::int16_t{1});
            put(bytes, 254, static_cast<std::int16_t>(sform_code));
            const Vector3 moved{30, -20, 55};
            for (int axis = 0; axis < 3; ++axis)
                put(bytes, 268 + 4 * axis,
                    static_cast<float>(ras_volume().origin[axis] + moved[axis]));
            if (mirrored) {  // half a turn about y, and the z axis against it: x alone is exchanged
                put(bytes, 260, 1.0f);
                put(bytes, 76, -1.0f);
            }
            const std::string path = folder.write("a.nii", bytes);
            options.reading.orientation = Orientation::automatic;
            const auto automatic = import_label_map(path, options);
            EXPECT_EQ(wrong_voxels(automatic), 0u);
            EXPECT_TRUE(says(automatic, "mm apart")) << sform_code;
            EXPECT_EQ(says(automatic, "right and left differ"), mirrored);
            options.reading.orientation = Orientation::sform;
            const auto sform = import_label_map(path, options);
            EXPECT_EQ(wrong_voxels(sform), 0u);
            EXPECT_FALSE(says(sform, "apart"));
            options.reading.orientation = Orientation::qform;
            const auto qform = import_label_map(path, options);
            if (!mirrored)
                EXPECT_EQ(wrong_voxels(qform, moved), 0u);
            else
                EXPECT_NE(wrong_voxels(qform), 0u);
        }
    }
    // Within half a voxel the two agree.
    std::string near = testing::nifti_bytes(ras_volume());
    put(near, 252, std::int16_t{1});
    for (int axis = 0; axis < 3; ++axis)
        put(near, 268 + 4 * axis, static_cast<float>(ras_volume().origin[axis] + 0.5));
    const auto imported = import_label_map(folder.write("n.nii", near), options);
    EXPECT_TRUE(imported->report.warnings.empty());
    // What is asked for must be there.
    std::string none = testing::nifti_bytes(ras_volume());
    options.reading.orientation = Orientation::qform;
    expect_refused(import_label_map(folder.write("q.nii", none), options), "no qform");
}

TEST(VolumeGeometry, ScaledIntegersOfEveryKindAreWholeLabels) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const std::string plain = testing::nifti_bytes(ras_volume());
    const auto with = [&](int datatype, double slope, double intercept, auto one) {
        std::string bytes = plain.substr(0, 352);
        put(bytes, 70, static_cast<std::int16_t>(datatype));
        put(bytes, 72, static_cast<std::int16_t>(8 * sizeof one));
        put(bytes, 112, static_cast<float>(slope));
        put(bytes, 116, static_cast<float>(intercept));
        for (const std::uint8_t voxel : ras_volume().voxels) {
            const auto stored = static_cast<decltype(one)>(
                std::lround((voxel - static_cast<double>(static_cast<float>(intercept))) /
                            static_cast<double>(static_cast<float>(slope))));
            bytes.append(reinterpret_cast<const char*>(&stored), sizeof stored);
        }
        return import_label_map(folder.write("s.nii.gz", testing::gzip_bytes(bytes)), options);
    };
    EXPECT_EQ(wrong_voxels(with(2, 0.5, 0, std::uint8_t{})), 0u);
    EXPECT_EQ(wrong_voxels(with(256, 1, 100, std::int8_t{})), 0u);
    EXPECT_EQ(wrong_voxels(with(4, 0.5, 0, std::int16_t{})), 0u);
    EXPECT_EQ(wrong_voxels(with(4, 1, -1024, std::int16_t{})), 0u);
    EXPECT_EQ(wrong_voxels(with(512, 2, -8, std::uint16_t{})) != 0, true);  // odd labels are lost
    EXPECT_EQ(wrong_voxels(with(8, 0.25, 3, std::int32_t{})), 0u);
    // As nibabel writes labels up to 201 that are floating point into 16 bits: off by .0015.
    EXPECT_EQ(wrong_voxels(with(4, 201.0 / 65535, 100.5, std::int16_t{})), 0u);
    // A step of a third does not leave whole numbers.
    std::string third = plain;
    put(third, 112, 1 / 3.0f);
    expect_refused(import_label_map(folder.write("t.nii", third), options), "not whole");
    // 0 and NaN mean that nothing is scaled.
    for (const float slope : {0.0f, kNaN}) {
        std::string bytes = plain;
        put(bytes, 112, slope);
        put(bytes, 116, kNaN);
        EXPECT_EQ(wrong_voxels(import_label_map(folder.write("z.nii", bytes), options)), 0u);
    }
    std::string infinite = plain;
    put(infinite, 112, kInf);
    expect_refused(import_label_map(folder.write("i.nii", infinite), options), "scl_slope");
}

TEST(VolumeGeometry, NamesOfFilesDoNotDecideHowTheyArePacked) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const std::string nifti = testing::nifti_bytes(ras_volume()),
                      packed = testing::gzip_bytes(nifti);
    for (const auto& [name, bytes] : {std::pair{"A.NII.GZ", packed},
                                      {"b.nii", packed},
                                      {"c.nii.gz", nifti},
                                      {"D.Nii", nifti},
                                      {"E.NRRD", testing::nrrd_bytes(ras_volume())},
                                      {"F.MHA", testing::mha_bytes(ras_volume())}})
        EXPECT_EQ(wrong_voxels(import_label_map(folder.write(name, bytes), options)), 0u) << name;
}

// Every number of a NIfTI-1 header that the reader uses, in the layout of NIfTI-2.
std::string nifti2_bytes(const TinyVolume& volume) {
    std::string bytes(544, '\0');
    put(bytes, 0, std::int32_t{540});
    std::memcpy(bytes.data() + 4, "n+2\0\r\n\032\n", 8);
    put(bytes, 12, std::int16_t{2});
    put(bytes, 14, std::int16_t{8});
    const std::int64_t dim[8] = {3, volume.size.x, volume.size.y, volume.size.z, 1, 1, 1, 1};
    std::memcpy(bytes.data() + 16, dim, sizeof dim);
    put(bytes, 104, 1.0);
    for (int axis = 0; axis < 3; ++axis)
        put(bytes, 112 + 8 * axis, norm(volume.columns.column(axis)));
    put(bytes, 168, std::int64_t{544});
    put(bytes, 348, std::int32_t{2});
    put(bytes, 500, std::int32_t{2});
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
            put(bytes, 400 + 32 * row + 8 * column, volume.columns(row, column));
        put(bytes, 424 + 32 * row, volume.origin[row]);
    }
    return bytes + std::string(volume.voxels.begin(), volume.voxels.end());
}

TEST(VolumeGeometry, SecondVersionOfNiftiIsReadAsTheFirst) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const std::string bytes = nifti2_bytes(ras_volume());
    EXPECT_EQ(wrong_voxels(import_label_map(folder.write("a.nii", bytes), options)), 0u);
    EXPECT_EQ(wrong_voxels(
                  import_label_map(folder.write("a.nii.gz", testing::gzip_bytes(bytes)), options)),
              0u);
    std::string broken = bytes;
    put(broken, 432, std::numeric_limits<double>::quiet_NaN());
    expect_refused(import_label_map(folder.write("b.nii", broken), options), "srow_y");
}

TEST(VolumeGeometry, HeaderThatIsNoNiftiIsRefused) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    std::string bytes = testing::nifti_bytes(ras_volume());
    bytes.replace(344, 4, std::string(4, '\0'));
    expect_refused(import_label_map(folder.write("a.nii", bytes), options), "ANALYZE");
    bytes.replace(344, 4, std::string("ni1\0", 4));
    expect_refused(import_label_map(folder.write("p.nii", bytes), options), "pair of files");
    expect_refused(import_label_map(folder.write("t.nii", "a text"), options), "NIfTI header");
    std::string colour = testing::nifti_bytes(ras_volume());
    put(colour, 70, std::int16_t{128});
    expect_refused(import_label_map(folder.write("c.nii", colour), options), "datatype");
}

TEST(VolumeGeometry, UnitsOfTheHeaderCountWhereTheyMakeABody) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    TinyVolume metres = ras_volume();
    for (double& entry : metres.columns.m) entry *= 0.001;
    for (int axis = 0; axis < 3; ++axis) metres.origin[axis] *= 0.001;
    std::string bytes = testing::nifti_bytes(metres);
    bytes[123] = 1;
    const auto imported = import_label_map(folder.write("m.nii", bytes), options);
    EXPECT_EQ(wrong_voxels(imported, {}, 1e-3), 0u);
    EXPECT_TRUE(says(imported, "metres"));
    // The unit alone is wrong.
    bytes = testing::nifti_bytes(ras_volume());
    bytes[123] = 1;
    const auto wrong = import_label_map(folder.write("w.nii", bytes), options);
    EXPECT_EQ(wrong_voxels(wrong), 0u);
    EXPECT_TRUE(says(wrong, "taken as millimetres"));
}

TEST(VolumeGeometry, NumbersOfTextHeadersThatAreNotFiniteAreRefusedByTheirField) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const auto with = [&](const char* name, std::string bytes, const std::string& from,
                          const std::string& to) {
        const std::size_t at = bytes.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        return import_label_map(folder.write(name, bytes.replace(at, from.size(), to)), options);
    };
    const std::string nrrd = testing::nrrd_bytes(ras_volume()),
                      mha = testing::mha_bytes(ras_volume());
    for (const char* value : {"nan", "inf", "-inf", "x"}) {
        const std::string v(value);
        expect_refused(with("a.nrrd", nrrd, "(-2,", "(" + v + ","), "space directions");
        expect_refused(with("a.nrrd", nrrd, "space origin: (20", "space origin: (" + v),
                       "space origin");
        expect_refused(with("a.nrrd", nrrd, "sizes: 48", "sizes: " + v), "sizes");
        expect_refused(with("a.mha", mha, "ElementSpacing = 2", "ElementSpacing = " + v),
                       "ElementSpacing");
        expect_refused(with("a.mha", mha, "Offset = 20", "Offset = " + v), "Offset");
        expect_refused(with("a.mha", mha, "TransformMatrix = -1", "TransformMatrix = " + v),
                       "TransformMatrix");
        expect_refused(with("a.mha", mha, "DimSize = 48", "DimSize = " + v), "DimSize");
    }
    expect_refused(with("a.mha", mha, "ElementSpacing = 2", "ElementSpacing = 0"),
                   "ElementSpacing");
    expect_refused(with("a.mha", mha, "TransformMatrix = -1", "TransformMatrix = -2"), "length 2");
    expect_refused(with("a.nrrd", nrrd, "(-2,", "(0,"), "0 mm along axis 1");
}

TEST(VolumeGeometry, EverySpaceOfNrrdIsTurnedToThePatient) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const std::string ras = testing::nrrd_bytes(ras_volume(), "", /*lps=*/false);
    const auto with = [&](const std::string& space, Vector3 sign) {
        TinyVolume volume = ras_volume();
        for (int row = 0; row < 3; ++row) {
            for (int column = 0; column < 3; ++column) volume.columns(row, column) *= sign[row];
            volume.origin[row] *= sign[row];
        }
        std::string bytes = testing::nrrd_bytes(volume, "", /*lps=*/false);
        const std::string old = "space: right-anterior-superior\n";
        bytes.replace(bytes.find(old), old.size(), space);
        return import_label_map(folder.write("a.nrrd", bytes), options);
    };
    EXPECT_EQ(wrong_voxels(with("space: RAS\n", {1, 1, 1})), 0u);
    EXPECT_EQ(wrong_voxels(with("space: left-anterior-superior\n", {-1, 1, 1})), 0u);
    EXPECT_EQ(wrong_voxels(with("space: LPS\n", {-1, -1, 1})), 0u);
    const auto unknown = with("space dimension: 3\n", {-1, -1, 1});
    EXPECT_EQ(wrong_voxels(unknown), 0u);
    EXPECT_TRUE(says(unknown, "right and left may be exchanged"));
    const auto metres = with("space: LPS\nspace units: \"m\" \"m\" \"m\"\n", {-1, -1, 1});
    ASSERT_FALSE(metres.has_value());  // a body of 96 m
    EXPECT_NE(metres.error().expected.find("--scale"), std::string::npos);
}

std::string bzip2_bytes(const std::string& bytes) {
    std::string packed(bytes.size() + bytes.size() / 100 + 600, '\0');
    auto size = static_cast<unsigned>(packed.size());
    BZ2_bzBuffToBuffCompress(packed.data(), &size, const_cast<char*>(bytes.data()),
                             static_cast<unsigned>(bytes.size()), 1, 0, 0);
    packed.resize(size);
    return packed;
}

TEST(VolumeGeometry, NrrdThatIsPackedWithBzip2IsReadAsAnyOther) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const std::string raw = testing::nrrd_bytes(ras_volume());
    const std::size_t end = raw.find("\n\n") + 2;
    const std::string voxels = raw.substr(end);
    const auto header = [&](const std::string& encoding, const std::string& type) {
        std::string text = raw.substr(0, end);
        text.replace(text.find("encoding: raw"), 13, "encoding: " + encoding);
        return text.replace(text.find("unsigned char"), 13, type);
    };
    const auto read = [&](const std::string& bytes) {
        return import_label_map(folder.write("a.nrrd", bytes), options);
    };
    const std::string half = voxels.substr(0, 3000), rest = voxels.substr(3000);
    for (const std::string& bytes :
         {header("bzip2", "unsigned char") + bzip2_bytes(voxels),
          header("BZ2", "uint8_t") + bzip2_bytes(half) + bzip2_bytes(rest)}) {
        const auto imported = read(bytes);
        EXPECT_EQ(wrong_voxels(imported), 0u);
        EXPECT_TRUE(imported->report.warnings.empty());
    }
    std::string wide;  // of 16 bits, the upper byte first
    for (const char value : voxels) wide += std::string(1, '\0') + value;
    EXPECT_EQ(wrong_voxels(read("NRRD0004\nendian: big\n" +
                                header("bz2", "unsigned short int").substr(9) + bzip2_bytes(wide))),
              0u);
    // In a file of its own.
    folder.write("b.raw.bz2", bzip2_bytes(voxels));
    std::string apart = header("bzip2", "uchar");
    apart.insert(apart.size() - 1, "data file: b.raw.bz2\n");
    EXPECT_EQ(wrong_voxels(import_label_map(folder.write("b.nhdr", apart), options)), 0u);
    // Names of segments come with it.
    std::string segments = header("bzip2", "uchar");
    segments.insert(segments.size() - 1, "Segment0_Name:=lien\nSegment0_LabelValue:=1\n");
    const auto with_names =
        import_label_map(folder.write("s.seg.nrrd", segments + bzip2_bytes(voxels)));
    ASSERT_TRUE(with_names.has_value()) << std::string(with_names.error().message());
    EXPECT_EQ(with_names->labels.labels[1].name, "lien");

    const std::string packed = bzip2_bytes(voxels);
    for (std::size_t length = 0; length < packed.size(); length += 1 + packed.size() / 9)
        expect_refused(read(header("bzip2", "uchar") + packed.substr(0, length)), "cut off");
    std::string damaged = packed;
    damaged[packed.size() / 2] ^= 0x55;
    expect_refused(read(header("bzip2", "uchar") + damaged), "damaged");
    // 30 MB of zeros in 50 bytes: no room is made for what the header does not ask for.
    expect_refused(read(header("bzip2", "uchar") + bzip2_bytes(std::string(30 << 20, '\0'))),
                   "more voxels than its header asks for");
    expect_refused(read(header("bzip2", "block") + packed), "voxels of type block");
    std::string skips = header("bzip2", "uchar");
    skips.insert(skips.size() - 1, "byte skip: 4\n");
    expect_refused(read(skips + packed), "skips");
}

TEST(VolumeGeometry, WhatTextHeadersSayTwiceIsCompared) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const std::string mha = testing::mha_bytes(ras_volume());  // its matrix runs "LPI"
    const auto with = [&](const std::string& line, const std::string& without = "") {
        std::string bytes = mha;
        if (!without.empty()) {
            const std::size_t at = bytes.find(without);
            bytes.erase(at, bytes.find('\n', at) + 1 - at);
        }
        bytes.insert(bytes.find("DimSize"), line + "\n");
        return import_label_map(folder.write("a.mha", bytes), options);
    };
    for (const char* letters : {"LPI", "lpi", "???", "LP", "LLI"}) {
        const auto imported = with(std::string("AnatomicalOrientation = ") + letters);
        EXPECT_EQ(wrong_voxels(imported), 0u);
        EXPECT_TRUE(imported->report.warnings.empty()) << letters;
    }
    const auto other = with("AnatomicalOrientation = RAI");
    EXPECT_EQ(wrong_voxels(other), 0u);
    EXPECT_TRUE(says(other, "AnatomicalOrientation says RAI and TransformMatrix LPI"));
    // Alone it says how the axes lie.
    const auto alone = with("AnatomicalOrientation = LPI", "TransformMatrix");
    EXPECT_EQ(wrong_voxels(alone), 0u);
    EXPECT_TRUE(says(alone, "taken from AnatomicalOrientation (LPI"));
    EXPECT_TRUE(with("ElementSize = 2 4 3")->report.warnings.empty());
    const auto sizes = with("ElementSize = 1 1 1");
    EXPECT_EQ(wrong_voxels(sizes), 0u);
    EXPECT_TRUE(says(sizes, "2 x 4 x 3 mm apart by ElementSpacing and are 1 x 1 x 1 mm"));

    const std::string nrrd = testing::nrrd_bytes(ras_volume());
    const auto without_directions = [&](const std::string& added) {
        std::string bytes = nrrd;
        for (const char* key : {"space: ", "space directions", "space origin"}) {
            const std::size_t at = bytes.find(key);
            bytes.erase(at, bytes.find('\n', at) + 1 - at);
        }
        bytes.insert(bytes.find("encoding"), added + "\n");
        return import_label_map(folder.write("a.nrrd", bytes), options);
    };
    // Sizes and middles of voxels from the ends of their axes.
    for (const char* ends :
         {"axis mins: 0 0 0\naxis maxs: 96 64 48\ncenterings: cell cell cell",
          "axis mins: 1 2 1.5\naxis maxs: 95 62 46.5\ncenterings: node node node",
          "axismins: 0 0 0\naxismaxs: 96 64 48"}) {
        const auto imported = without_directions(ends);
        ASSERT_TRUE(imported.has_value()) << std::string(imported.error().message());
        EXPECT_NEAR(imported->labels.grid.spacing_mm.x, 2, 1e-9) << ends;
        EXPECT_NEAR(imported->labels.grid.spacing_mm.z, 3, 1e-9) << ends;
        EXPECT_NEAR(imported->labels.grid.origin_mm.z, 1.5, 1e-9) << ends;
        EXPECT_TRUE(says(imported, "axis mins and axis maxs")) << ends;
    }
    const auto centimetres = without_directions("spacings: .2 .4 .3\nunits: \"cm\" \"cm\" \"cm\"");
    ASSERT_TRUE(centimetres.has_value()) << std::string(centimetres.error().message());
    EXPECT_NEAR(centimetres->labels.grid.spacing_mm.y, 4, 1e-9);
    EXPECT_TRUE(says(centimetres, "(units)"));
}

TEST(VolumeGeometry, GeometryThatNobodyGaveIsTold) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    TinyVolume lost = ras_volume();
    lost.columns = Matrix3{};
    lost.origin = {0, 0, 0};
    TinyVolume lost_lps = lost;
    lost_lps.columns = Matrix3::diagonal({-1, -1, 1});
    const char* words = "without the geometry of its scan";
    EXPECT_TRUE(
        says(import_label_map(folder.write("a.nii", testing::nifti_bytes(lost)), options), words));
    EXPECT_TRUE(says(
        import_label_map(folder.write("a.nrrd", testing::nrrd_bytes(lost_lps)), options), words));
    EXPECT_TRUE(says(import_label_map(folder.write("a.mha", testing::mha_bytes(lost_lps)), options),
                     words));
    lost.origin.z = 1;
    EXPECT_FALSE(
        says(import_label_map(folder.write("a.nii", testing::nifti_bytes(lost)), options), words));
}

TEST(VolumeGeometry, SlightShearIsSquaredOffAndMoreIsResampledOnRequest) {
    const TemporaryFolder folder;
    ImportOptions options = named(folder);
    TinyVolume volume = ras_volume();
    volume.columns(1, 2) = 0.005 * volume.columns(2, 2);  // 0.11 mm over 45 mm, voxels of 2 mm
    const auto slight =
        import_label_map(folder.write("s.nii", testing::nifti_bytes(volume)), options);
    EXPECT_EQ(wrong_voxels(slight, {}, 0.2), 0u);
    EXPECT_TRUE(says(slight, "squared off"));
    // A gantry tilted by 17 degrees: the body sampled along the slanted axes.
    const TinyVolume plain = ras_volume();
    Matrix3 slanted = plain.columns;
    slanted(1, 2) = 0.3 * slanted(2, 2);
    const TinyVolume tilted =
        testing::sample({48, 24, 16}, slanted, plain.origin - Vector3{0, 16, 0}, shifted_body);
    options.reading.resample_shear = true;
    for (const auto& [name, bytes] : {std::pair{"t.nii", testing::nifti_bytes(tilted)},
                                      {"t.nrrd", testing::nrrd_bytes(tilted)}}) {
        const auto resampled = import_label_map(folder.write(name, bytes), options);
        // The nearest voxel is at most half a voxel away along each slanted axis.
        EXPECT_EQ(wrong_voxels(resampled, {}, 2.5), 0u) << name;
        EXPECT_TRUE(says(resampled, "resampled"));
    }
}

// As programs write them that crop each structure to its box.
TEST(VolumeGeometry, MasksCroppedToTheirBoxesAreJoinedOnTheirLattice) {
    const TemporaryFolder folder;
    const TinyVolume whole = ras_volume();
    for (const auto& [name, value, shift] :
         {std::tuple{"kidney_right", 2, 0.0}, {"liver", 5, 0.15}, {"spleen", 1, -0.1}}) {
        Int3 low = whole.size, high{-1, -1, -1};
        std::size_t n = 0;
        for (int k = 0; k < whole.size.z; ++k)
            for (int j = 0; j < whole.size.y; ++j)
                for (int i = 0; i < whole.size.x; ++i, ++n)
                    if (whole.voxels[n] == value) {
                        low = {std::min(low.x, i), std::min(low.y, j), std::min(low.z, k)};
                        high = {std::max(high.x, i), std::max(high.y, j), std::max(high.z, k)};
                    }
        // Off the lattice by less than a tenth of a voxel, as sums of rounded numbers are.
        const TinyVolume mask =
            testing::sample({high.x - low.x + 1, high.y - low.y + 1, high.z - low.z + 1},
                            whole.columns, whole.position(low.x, low.y, low.z),
                            [value = value](Point3 p) { return shifted_body(p) == value ? 1 : 0; });
        TinyVolume moved = mask;
        moved.origin.x += shift;
        folder.write(std::string("m/") + name + ".nii", testing::nifti_bytes(moved));
    }
    const auto imported = import_label_map(folder / "m");
    EXPECT_EQ(wrong_voxels(imported), 0u);
    EXPECT_EQ(imported->labels.labels.size(), 4u);
    // What is said of a map is said of a mask as well.
    std::string bytes = testing::nifti_bytes(ras_volume());
    for (std::size_t v = 352; v < bytes.size(); ++v) bytes[v] = bytes[v] == kLiver;
    put(bytes, 254, std::int16_t{0});
    folder.write("n/liver.nii", bytes);
    const auto lost = import_label_map(folder / "n");
    ASSERT_TRUE(lost.has_value());
    EXPECT_TRUE(says(lost, "liver.nii: the file does not say how its axes lie"));
}

TEST(VolumeGeometry, ChannelsOfZeroAndOneAreOneStructureEach) {
    const TemporaryFolder folder;
    ImportOptions options = named(folder);
    const auto channels = [&](bool background, int highest) {
        std::string bytes = testing::nifti_bytes(ras_volume()).substr(0, 352);
        put(bytes, 40, std::int16_t{4});
        put(bytes, 48, static_cast<std::int16_t>(background ? 6 : 5));
        for (int c = background ? 0 : 1; c <= 5; ++c)
            for (const std::uint8_t voxel : ras_volume().voxels)
                bytes += static_cast<char>(voxel == c ? highest : 0);
        return import_label_map(folder.write("c.nii", bytes), options);
    };
    EXPECT_EQ(wrong_voxels(channels(true, 1)), 0u);
    EXPECT_EQ(wrong_voxels(channels(false, 1)), 0u);
    EXPECT_TRUE(says(channels(true, 1), "channels"));
    expect_refused(channels(true, 7), "channels whose values are not 0 and 1");
}

std::string changed(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

// The header of a file whose voxels follow it.
std::string header_of(const std::string& bytes) {
    return bytes.substr(0, bytes.size() - ras_volume().voxels.size());
}

// The library leaves out what is not there, and the slices behind it come to lie one step lower.
TEST(VolumeGeometry, EveryFileThatAHeaderNamesIsThere) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const TinyVolume volume = ras_volume();
    const std::size_t slice = volume.voxels.size() / static_cast<std::size_t>(volume.size.z);
    const std::string data(volume.voxels.begin(), volume.voxels.end());
    std::string list;
    for (int k = 0; k < volume.size.z; ++k) {
        const std::string name = "s" + std::string(k < 10 ? "0" : "") + std::to_string(k) + ".raw";
        folder.write(name, data.substr(static_cast<std::size_t>(k) * slice, slice));
        list += "\n" + name;
    }
    const std::string last = std::to_string(volume.size.z - 1),
                      beyond = std::to_string(volume.size.z);
    const std::string mhd = header_of(testing::mha_bytes(volume));
    std::string nhdr = header_of(testing::nrrd_bytes(volume));
    nhdr.pop_back();  // the empty line
    const auto meta = [&](const std::string& files) {
        return import_label_map(folder.write("a.mhd", changed(mhd, "LOCAL", files)), options);
    };
    const auto nrrd = [&](const std::string& files) {
        return import_label_map(folder.write("a.nhdr", nhdr + "data file: " + files + "\n"),
                                options);
    };
    for (const std::string& files : {"s%02d.raw 0 " + last + " 1", "LIST" + list}) {
        EXPECT_EQ(wrong_voxels(meta(files)), 0u) << files;
        EXPECT_EQ(wrong_voxels(nrrd(files)), 0u) << files;
    }
    for (const auto& read : {meta("s%02d.raw 1 " + beyond + " 1"), meta("LIST" + list + "\nx.raw"),
                             nrrd("s%02d.raw 1 " + beyond + " 1"), nrrd("LIST" + list + "\nx.raw")})
        expect_refused(read, "is not there, one of ");
    for (const auto& read :
         {meta("s%02d.raw 1 " + last + " 1"), nrrd("s%02d.raw 1 " + last + " 1")})
        expect_refused(read, "header asks for");
    for (const char* odd : {"s%s.raw 0 9 1", "s%02d%n.raw 0 9 1", "s%02d.raw", "s%02d.raw 0 9 0"})
        expect_refused(meta(odd), "the pattern of its data files");
}

TEST(VolumeGeometry, BytesThatTheHeaderDoesNotAccountForAreTold) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const TinyVolume volume = ras_volume();
    const std::string data(volume.voxels.begin(), volume.voxels.end());
    folder.write("a.raw", std::string(100, 'h') + data);
    std::string nhdr = header_of(testing::nrrd_bytes(volume));
    nhdr.pop_back();
    const std::string mhd = changed(header_of(testing::mha_bytes(volume)),
                                    "ElementDataFile = LOCAL", "ElementDataFile = a.raw");
    const auto meta = [&](const std::string& more) {
        return import_label_map(
            folder.write("a.mhd", changed(mhd, "ElementDataFile", more + "ElementDataFile")),
            options);
    };
    const auto nrrd = [&](const std::string& more) {
        return import_label_map(folder.write("a.nhdr", nhdr + more + "data file: a.raw\n"),
                                options);
    };
    EXPECT_TRUE(says(meta(""), "holds 100 bytes more than its header asks for"));
    EXPECT_TRUE(says(nrrd(""), "holds 100 bytes more than its header asks for"));
    for (const auto& read : {meta("HeaderSize = -1\n"), meta("HeaderSize = 100\n"),
                             nrrd("byte skip: -1\n"), nrrd("byte skip: 100\n")}) {
        EXPECT_EQ(wrong_voxels(read), 0u);
        EXPECT_FALSE(says(read, "bytes more"));
    }
    const std::string packed = testing::mha_bytes(volume, true);
    const std::size_t at = packed.find("CompressedDataSize = ") + 21;
    std::string fewer = packed;
    fewer.replace(at, packed.find('\n', at) - at, "40");
    expect_refused(import_label_map(folder.write("c.mha", fewer), options),
                   "CompressedDataSize of the header is 40");
}

TEST(VolumeGeometry, WhatAnNrrdHeaderLacksIsNamed) {
    const TemporaryFolder folder;
    const ImportOptions options = named(folder);
    const TinyVolume volume = ras_volume();
    const std::string good = testing::nrrd_bytes(volume);
    const auto read = [&](const std::string& bytes) {
        return import_label_map(folder.write("a.nrrd", bytes), options);
    };
    expect_refused(read(changed(good, "left-posterior-superior", "RPI")), "the space 'RPI'");
    std::string words;
    for (const std::uint8_t voxel : volume.voxels) words += {static_cast<char>(voxel), '\0'};
    const std::string wide = changed(header_of(good), "unsigned char", "short");
    expect_refused(read(wide + words), "(endian)");
    const auto with_order = [&](const char* order) {
        return wide.substr(0, wide.size() - 1) + "endian: " + order + "\n\n" + words;
    };
    EXPECT_EQ(wrong_voxels(read(with_order("little"))), 0u);
    // Bytes in the other order make multiples of 256.
    ImportOptions unnamed;
    expect_refused(import_label_map(folder.write("a.nrrd", with_order("big")), unnamed),
                   "every value is a multiple of 256");
    expect_refused(read(changed(good, "sizes: ", "sizes: 1 1 ")), "axes");
    const std::size_t at = good.find("space origin");
    std::string without = good;
    without.erase(at, good.find('\n', at) + 1 - at);
    EXPECT_TRUE(says(read(without), "no origin (space origin)"));
    const std::string meta = testing::mha_bytes(volume);
    EXPECT_TRUE(
        says(import_label_map(folder.write("a.mha", changed(meta, "\nOffset", "\nOther")), options),
             "no origin (Offset)"));
}

TEST(VolumeGeometry, ASingleSliceIsNoVolume) {
    const TemporaryFolder folder;
    std::string bytes = testing::nifti_bytes(ras_volume());
    const std::int16_t one = 1;
    put(bytes, 46, one);
    bytes.resize(352 + static_cast<std::size_t>(ras_volume().size.x * ras_volume().size.y));
    bytes[352 + 700] = 1;
    expect_refused(import_label_map(folder.write("a.nii", bytes), named(folder)), "a single slice");
}

}  // namespace
}  // namespace sonocase::pipeline
