// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/nifti_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>

#include <zlib.h>

#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_volume {

namespace {

constexpr const char* kExportAgain = "export the volume again";
constexpr const char* kCutOff = "the file is cut off or damaged; copy or export it again";

// Where the fields of a header are, and numbers of either byte order.
class Fields {
  public:
    Fields(std::span<const std::uint8_t> bytes, bool swapped, bool second)
        : bytes_(bytes), swapped_(swapped), second_(second) {}

    std::int64_t whole(std::size_t at1, std::size_t at2, std::size_t size1, std::size_t size2) {
        const std::size_t at = second_ ? at2 : at1, size = second_ ? size2 : size1;
        return size == 1   ? bytes_[at]
               : size == 2 ? number<std::int16_t>(at)
               : size == 4 ? number<std::int32_t>(at)
                           : number<std::int64_t>(at);
    }
    double real(std::size_t at1, std::size_t at2, std::size_t index = 0) {
        return second_ ? number<double>(at2 + 8 * index)
                       : static_cast<double>(number<float>(at1 + 4 * index));
    }

  private:
    template <class T>
    T number(std::size_t at) const {
        std::array<std::uint8_t, sizeof(T)> b;
        std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), sizeof(T), b.begin());
        if (swapped_) std::reverse(b.begin(), b.end());
        return std::bit_cast<T>(b);
    }
    std::span<const std::uint8_t> bytes_;
    bool swapped_, second_;
};

std::int32_t int_at(const std::uint8_t* bytes, bool swapped) {
    std::array<std::uint8_t, 4> b{bytes[0], bytes[1], bytes[2], bytes[3]};
    if (swapped) std::reverse(b.begin(), b.end());
    return std::bit_cast<std::int32_t>(b);
}

std::optional<Component> component_of_datatype(int datatype) {
    switch (datatype) {
        case 2: return Component::u8;
        case 4: return Component::i16;
        case 8: return Component::i32;
        case 16: return Component::f32;
        case 64: return Component::f64;
        case 256: return Component::i8;
        case 512: return Component::u16;
        case 768: return Component::u32;
        case 1024: return Component::i64;
        case 1280: return Component::u64;
        default: return std::nullopt;
    }
}

Error not_finite(const std::string& field, const std::string& path) {
    return {"geometry in the header is not a number (" + field + ")", path, kExportAgain};
}

// One of the two transforms that a header may hold, in units of the file.
struct Transform {
    int code = 0;
    Matrix3 columns;
    Point3 origin;
};

Result<Transform> read_sform(Fields& fields, int code, const std::string& path) {
    Transform t;
    t.code = code;
    const std::size_t at1[3] = {280, 296, 312}, at2[3] = {400, 432, 464};
    const char* names[3] = {"srow_x", "srow_y", "srow_z"};
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 4; ++column) {
            const double value = fields.real(at1[row], at2[row], static_cast<std::size_t>(column));
            if (!std::isfinite(value)) return not_finite(names[row], path);
            if (column < 3)
                t.columns(row, column) = value;
            else
                t.origin[row] = value;
        }
    }
    return t;
}

Result<Transform> read_qform(Fields& fields,
                             int code,
                             const double (&pixdim)[4],
                             const std::string& path) {
    Transform t;
    t.code = code;
    double q[3];
    const char* names[6] = {"quatern_b", "quatern_c", "quatern_d",
                            "qoffset_x", "qoffset_y", "qoffset_z"};
    for (std::size_t n = 0; n < 6; ++n) {
        const double value = fields.real(256, 352, n);
        if (!std::isfinite(value)) return not_finite(names[n], path);
        if (n < 3)
            q[n] = value;
        else
            t.origin[static_cast<int>(n) - 3] = value;
    }
    const double length = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
    if (length > 1.01)
        return Error{text("the header's quaternion is of length %.3g, and no rotation (quatern_b, "
                          "quatern_c, quatern_d)",
                          std::sqrt(length)),
                     path, kExportAgain};
    const Quaternion turn{std::sqrt(std::max(0.0, 1 - length)), q[0], q[1], q[2]};
    t.columns = rotation_from_quaternion(turn);
    for (int axis = 0; axis < 3; ++axis) {
        const double step = pixdim[axis + 1] * (axis == 2 && pixdim[0] < 0 ? -1 : 1);
        for (int row = 0; row < 3; ++row) t.columns(row, axis) *= step;
    }
    return t;
}

Point3 place(const Transform& t, Vector3 voxel) {
    return t.origin + t.columns * voxel;
}

// The greatest distance between the places that two transforms give to a corner of the volume.
double furthest_apart(const Transform& a, const Transform& b, const std::int64_t (&dim)[8]) {
    double furthest = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vector3 voxel{(corner & 1) ? double(dim[1] - 1) : 0,
                            (corner & 2) ? double(dim[2] - 1) : 0,
                            (corner & 4) ? double(dim[3] - 1) : 0};
        furthest = std::max(furthest, distance(place(a, voxel), place(b, voxel)));
    }
    return furthest;
}

double shortest(const Matrix3& columns) {
    return std::min({norm(columns.column(0)), norm(columns.column(1)), norm(columns.column(2))});
}

// Columns so short or so much alike that they span no volume.
bool is_flat(const Matrix3& columns) {
    const double longest =
        std::max({norm(columns.column(0)), norm(columns.column(1)), norm(columns.column(2))});
    return !(shortest(columns) > 1e-6 * longest) ||
           !(std::abs(determinant(columns)) > 1e-6 * shortest(columns) * longest * longest * 1e-3);
}

Status read_sizes(Fields& fields, NiftiHeader& header, const std::string& path) {
    const std::int64_t count = fields.whole(40, 16, 2, 8);
    std::string sizes;
    for (std::size_t d = 1; d <= 7; ++d) {
        const std::int64_t size =
            static_cast<std::int64_t>(d) <= count ? fields.whole(40 + 2 * d, 16 + 8 * d, 2, 8) : 1;
        if (static_cast<std::int64_t>(d) <= count)
            sizes += (d > 1 ? " x " : "") + std::to_string(size);
        header.dim[d] = size == 0 && d > 3 ? 1 : size;
    }
    header.dim[0] = count;
    if (count < 1 || count > 7)
        return Error{"header says that there are " + std::to_string(count) + " dimensions (dim)",
                     path, "expected three; " + std::string(kExportAgain)};
    if (count < 3)
        return Error{"an image of " + sizes + " pixels", path,
                     "expected a volume of three dimensions"};
    for (int d = 1; d <= 3; ++d)
        if (header.dim[d] < 1 || header.dim[d] > 65535)
            return Error{"volume of " + sizes + " voxels (dim)", path,
                         "expected 1 to 65535 per side"};
    std::int64_t channels = 1;
    for (int d = 4; d <= 7; ++d) {
        if (header.dim[d] < 1 || header.dim[d] > 65535 || channels * header.dim[d] > 65535)
            return Error{"volume of " + sizes + " voxels (dim)", path,
                         "expected three dimensions; export one time step"};
        channels *= header.dim[d];
    }
    return Done{};
}

Status read_scale(Fields& fields, NiftiHeader& header, const std::string& path) {
    const double slope = fields.real(112, 176), intercept = fields.real(116, 184);
    if (std::isnan(slope) || slope == 0) return Done{};  // not scaled
    if (std::isinf(slope)) return not_finite("scl_slope", path);
    if (!std::isfinite(intercept)) return not_finite("scl_inter", path);
    header.slope = slope;
    header.intercept = intercept;
    return Done{};
}

// Millimetres per unit of the header.
double unit_mm(Fields& fields, const Placement& placement, std::vector<std::string>& warnings) {
    const std::int64_t code = fields.whole(123, 500, 1, 4);
    const auto unit = code & 7;
    if (unit != 1 && unit != 3) return 1;
    const double factor = unit == 1 ? 1000 : 0.001;
    const char* name = unit == 1 ? "metres" : "micrometres";
    double longest = 0;
    for (int axis = 0; axis < 3; ++axis)
        longest = std::max(longest, norm(placement.columns.column(axis)) * placement.size[axis]);
    const auto is_body = [](double mm) { return mm >= 20 && mm <= 3000; };
    if (!is_body(factor * longest) && is_body(longest)) {
        warnings.push_back(
            text("the header says %s (xyzt_units), which would make the volume %.3g "
                 "mm long: its numbers are taken as millimetres",
                 name, factor * longest));
        return 1;
    }
    warnings.push_back(
        text("the header says %s (xyzt_units): its numbers are multiplied by %g", name, factor));
    return factor;
}

void warn_of_disagreement(const Transform& sform,
                          const Transform& qform,
                          bool sform_taken,
                          double apart,
                          std::vector<std::string>& warnings) {
    const bool mirrored = (determinant(sform.columns) < 0) != (determinant(qform.columns) < 0);
    // Which way the axis that runs most nearly from left to right goes.
    const auto right = [](const Matrix3& columns) {
        double most = 0;
        int axis = 0;
        for (int a = 0; a < 3; ++a) {
            const double share = std::abs(columns(0, a)) / norm(columns.column(a));
            if (share > most + 1e-9) {
                most = share;
                axis = a;
            }
        }
        return std::pair{axis, columns(0, axis) > 0};
    };
    const bool sides = mirrored || right(sform.columns) != right(qform.columns);
    warnings.push_back(text(
        "sform (code %d) and qform (code %d) place the volume up to %.4g mm apart%s; the %s is "
        "taken: look where the organs lie, and choose with --orientation sform or qform",
        sform.code, qform.code, apart, sides ? ", and right and left differ" : "",
        sform_taken ? "sform" : "qform"));
}

Status read_placement(Fields& fields,
                      NiftiHeader& header,
                      const std::string& path,
                      Orientation orientation) {
    Placement& placement = header.placement;
    std::vector<std::string>& warnings = placement.warnings;
    for (int axis = 0; axis < 3; ++axis)
        placement.size[axis] = static_cast<std::int32_t>(header.dim[axis + 1]);

    double pixdim[4];
    for (std::size_t n = 0; n < 4; ++n) {
        pixdim[n] = fields.real(76, 104, n);
        if (n > 0 && !std::isfinite(pixdim[n]))
            return not_finite("pixdim[" + std::to_string(n) + "]", path);
    }
    const int sform_code = static_cast<int>(fields.whole(254, 348, 2, 4));
    const int qform_code = static_cast<int>(fields.whole(252, 344, 2, 4));
    bool has_sform = sform_code > 0, has_qform = qform_code > 0;
    if (orientation == Orientation::sform && !has_sform)
        return Error{
            "there is no sform in the header (its code is " + std::to_string(sform_code) + ")",
            path, "expected one, as --orientation sform asks for it"};
    if (orientation == Orientation::qform && !has_qform)
        return Error{
            "there is no qform in the header (its code is " + std::to_string(qform_code) + ")",
            path, "expected one, as --orientation qform asks for it"};
    std::optional<Transform> sform, qform;
    if (has_sform && orientation != Orientation::qform) {
        SONOCASE_TRY(sform, read_sform(fields, sform_code, path));
        if (is_flat(sform->columns)) {
            if (orientation == Orientation::sform || !has_qform)
                return Error{"the sform of the header spans no volume (srow_x, srow_y, srow_z)",
                             path, kExportAgain};
            warnings.push_back(
                "the sform of the header spans no volume (srow_x, srow_y, srow_z) and is left "
                "out: the qform is taken");
            sform.reset();
        }
    }
    std::string bad_pixdim;
    for (int n = 1; n <= 3; ++n)
        if (!(pixdim[n] > 0) && bad_pixdim.empty())
            bad_pixdim = text("pixdim[%d] of the header is %g", n, pixdim[n]);
    if (has_qform && orientation != Orientation::sform && !(sform && !bad_pixdim.empty())) {
        if (std::isnan(pixdim[0]) || std::isinf(pixdim[0])) return not_finite("pixdim[0]", path);
        if (bad_pixdim.empty()) {
            SONOCASE_TRY(qform, read_qform(fields, qform_code, pixdim, path));
        }
    }
    if (!sform && !bad_pixdim.empty())
        return Error{bad_pixdim, path,
                     "expected a voxel size above 0 mm; " + std::string(kExportAgain)};
    if (sform && !bad_pixdim.empty())
        warnings.push_back(bad_pixdim + ": voxel sizes are those of the sform");

    if (sform && qform) {
        const double apart = furthest_apart(*sform, *qform, header.dim);
        if (apart > 0.5 * std::min(shortest(sform->columns), shortest(qform->columns)))
            warn_of_disagreement(*sform, *qform, true, apart, warnings);
    }
    if (sform || qform) {
        const Transform& taken = sform ? *sform : *qform;
        placement.columns = taken.columns;
        placement.origin_mm = taken.origin;
    } else {
        for (int axis = 0; axis < 3; ++axis) {
            const double step = axis == 0 ? -pixdim[1] : pixdim[axis + 1];
            for (int row = 0; row < 3; ++row) placement.columns(row, axis) = row == axis ? step : 0;
            placement.origin_mm[axis] = -0.5 * step * (placement.size[axis] - 1);
        }
        warnings.push_back(
            "the file does not say how its axes lie in the patient (qform_code and sform_code are "
            "0), so right and left may be exchanged: its axes are taken to run to the left, to the "
            "front and to the head; check on which side the liver is, or export the file again "
            "with its orientation");
    }
    if (sform && bad_pixdim.empty()) {
        for (int axis = 0; axis < 3; ++axis) {
            const double length = norm(placement.columns.column(axis)), given = pixdim[axis + 1];
            if (std::abs(length - given) * placement.size[axis] <= 0.5 * length) {
                // Rounding of an oblique transform: the plain number is the better one.
                if (std::abs(length - given) < 1e-5 * given) placement.spacing_mm[axis] = given;
                continue;
            }
            warnings.push_back(
                text("voxels are %g mm along axis %d by the sform and %g by pixdim: "
                     "the sform is taken",
                     length, axis + 1, given));
        }
    } else if (qform) {
        placement.spacing_mm = {pixdim[1], pixdim[2], pixdim[3]};
    }
    const double unit = unit_mm(fields, placement, warnings);
    if (unit != 1) {
        for (double& entry : placement.columns.m) entry *= unit;
        placement.spacing_mm = unit * placement.spacing_mm;
        for (int axis = 0; axis < 3; ++axis) placement.origin_mm[axis] *= unit;
    }
    if (!is_finite(placement)) return not_finite("sform, qform or pixdim", path);
    return Done{};
}

struct CloseGz {
    void operator()(gzFile_s* file) const { gzclose(file); }
};
using GzFile = std::unique_ptr<gzFile_s, CloseGz>;

bool read_bytes(gzFile_s* file, void* to, std::size_t count) {
    return gzread(file, to, static_cast<unsigned>(count)) == static_cast<int>(count);
}

// As many of the first bytes of a file as a header and its mark of extensions may have.
std::vector<std::uint8_t> first_bytes(gzFile_s* file) {
    std::vector<std::uint8_t> bytes(348 + 4);
    int count = gzread(file, bytes.data(), static_cast<unsigned>(bytes.size()));
    bytes.resize(static_cast<std::size_t>(std::max(0, count)));
    if (bytes.size() < 4) return bytes;
    if (int_at(bytes.data(), false) != 540 && int_at(bytes.data(), true) != 540) return bytes;
    std::vector<std::uint8_t> more(540 - 348);
    count = gzread(file, more.data(), static_cast<unsigned>(more.size()));
    bytes.insert(bytes.end(), more.begin(), more.begin() + std::max(0, count));
    return bytes;
}

Error not_there(std::uint64_t position, std::uint64_t needed, const std::string& path) {
    return {"holds " + std::to_string(position) + " bytes of the " + std::to_string(needed) +
                " that its header asks for",
            path, kCutOff};
}

}  // namespace

std::uint64_t NiftiHeader::voxel_bytes() const {
    return static_cast<std::uint64_t>(dim[1]) * static_cast<std::uint64_t>(dim[2]) *
           static_cast<std::uint64_t>(dim[3]) * static_cast<std::uint64_t>(channels()) *
           bytes_of(component);
}

Result<NiftiHeader> parse_nifti_header(std::span<const std::uint8_t> bytes,
                                       const std::string& path,
                                       Orientation orientation) {
    const auto no_header = [&](const std::string& what) {
        return Error{what, path,
                     "expected NIfTI-1 or NIfTI-2 in a single file; copy or export it again"};
    };
    for (const auto& [sign, kind, advice] :
         {std::tuple<std::string_view, const char*, const char*>{
              "\x1f\x8b", "packed with gzip twice", "unpack it once (gunzip), and give that file"},
          {"BZh", "packed with bzip2", "unpack it (bunzip2), and give the .nii"},
          {"\xfd"
           "7zXZ",
           "packed with xz", "unpack it (unxz), and give the .nii"},
          {"\x28\xb5\x2f\xfd", "packed with zstd", "unpack it (unzstd), and give the .nii"},
          {"NRRD0", "an NRRD file", "give it a name that ends in .nrrd"}})
        if (bytes.size() >= sign.size() &&
            std::equal(sign.begin(), sign.end(), bytes.begin(),
                       [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; }))
            return Error{std::string("is no NIfTI file: it is ") + kind, path, advice};
    if (bytes.size() < 4) return no_header("file has no header");
    NiftiHeader header;
    header.bytes = int_at(bytes.data(), false);
    if (header.bytes != 348 && header.bytes != 540) {
        header.swapped = true;
        header.bytes = int_at(bytes.data(), true);
    }
    if (header.bytes != 348 && header.bytes != 540)
        return no_header("file does not begin with a NIfTI header");
    const bool second = header.bytes == 540;
    if (bytes.size() < static_cast<std::size_t>(header.bytes) + 4)
        return no_header("header is cut off after " + std::to_string(bytes.size()) + " bytes");
    const char* magic = reinterpret_cast<const char*>(bytes.data()) + (second ? 4 : 344);
    if (std::memcmp(magic, second ? "n+2" : "n+1", 4) != 0) {
        if (std::memcmp(magic, second ? "ni2" : "ni1", 4) == 0)
            return no_header("header is one of a pair of files (.hdr and .img)");
        return no_header("header is not marked as NIfTI (magic), and may be ANALYZE 7.5");
    }
    Fields fields(bytes, header.swapped, second);
    header.has_extensions = bytes[static_cast<std::size_t>(header.bytes)] != 0;
    SONOCASE_TRY_DONE(read_sizes(fields, header, path));
    header.datatype = static_cast<int>(fields.whole(70, 12, 2, 2));
    const auto component = component_of_datatype(header.datatype);
    if (!component)
        return Error{"voxels of NIfTI type " + std::to_string(header.datatype) + " (datatype)",
                     path, "expected whole numbers, one per voxel"};
    header.component = *component;
    if (second) {
        header.voxels_at = fields.whole(168, 168, 8, 8);
    } else {
        const double offset = fields.real(108, 0);
        if (!std::isfinite(offset)) return not_finite("vox_offset", path);
        header.voxels_at = offset < 2e9 ? static_cast<std::int64_t>(std::max(offset, 0.0)) : -1;
    }
    if (header.voxels_at < 0 || header.voxels_at > (std::int64_t{1} << 40))
        return Error{"header puts the voxels nowhere (vox_offset)", path, kExportAgain};
    header.voxels_at = std::max(header.voxels_at, header.bytes + 4);
    SONOCASE_TRY_DONE(read_scale(fields, header, path));
    SONOCASE_TRY_DONE(read_placement(fields, header, path, orientation));
    return header;
}

Result<NiftiHeader> read_nifti_header(const std::string& path, Orientation orientation) {
    const GzFile file(gzopen(path.c_str(), "rb"));
    if (!file) return Error{"cannot open", path, "check that it may be read"};
    return parse_nifti_header(first_bytes(file.get()), path, orientation);
}

Result<NativeVolume> read_nifti_volume(const std::string& path, const VolumeReading& reading) {
    const GzFile file(gzopen(path.c_str(), "rb"));
    if (!file) return Error{"cannot open", path, "check that it may be read"};
    gzbuffer(file.get(), 1 << 18);
    const std::vector<std::uint8_t> head = first_bytes(file.get());
    if (int status = Z_OK;
        head.empty() && gzerror(file.get(), &status) != nullptr && status == Z_DATA_ERROR)
        return Error{"damaged compression", path, kCutOff};
    SONOCASE_TRY(const auto header, parse_nifti_header(head, path, reading.orientation));
    NativeVolume volume;
    SONOCASE_TRY_DONE(place_volume(header.placement, reading, path, volume));
    volume.component = header.component;
    volume.layers = static_cast<int>(header.channels());
    volume.planar = true;
    volume.slope = header.slope;
    volume.intercept = header.intercept;

    if (header.voxel_bytes() > kMaxVolumeBytes)
        return Error{
            "header asks for " + std::to_string(header.voxel_bytes() >> 30) + " GB of voxels", path,
            kCutOff};
    // What a file of this length cannot hold is refused before room is made for it: gzip packs at
    // most 1032 to 1.
    const std::uint64_t needed =
        static_cast<std::uint64_t>(header.voxels_at) + header.voxel_bytes();
    std::error_code code;
    const std::uint64_t on_disk = std::filesystem::file_size(path, code);
    const bool packed = gzdirect(file.get()) == 0;
    if (!code && (packed ? 1032 * (on_disk + 64) : on_disk) < needed)
        return not_there(packed ? 0 : on_disk, needed, path);
    SONOCASE_TRY_DONE(check_room(volume, header.voxel_bytes(), path));
    volume.bytes.resize(header.voxel_bytes());
    std::vector<std::uint8_t> rest(1 << 18);
    std::uint64_t position = static_cast<std::uint64_t>(header.bytes) + 4;
    while (position < static_cast<std::uint64_t>(header.voxels_at)) {
        const std::size_t piece = std::min<std::size_t>(
            rest.size(), static_cast<std::uint64_t>(header.voxels_at) - position);
        if (!read_bytes(file.get(), rest.data(), piece)) return not_there(position, needed, path);
        position += piece;
    }
    for (std::size_t at = 0; at < volume.bytes.size();) {
        const std::size_t piece = std::min<std::size_t>(volume.bytes.size() - at, 1u << 28);
        const int count =
            gzread(file.get(), volume.bytes.data() + at, static_cast<unsigned>(piece));
        if (count > 0) position += static_cast<std::uint64_t>(count);
        if (count < static_cast<int>(piece)) return not_there(position, needed, path);
        at += piece;
    }
    std::uint64_t behind = 0;
    for (int count = 0;
         (count = gzread(file.get(), rest.data(), static_cast<unsigned>(rest.size()))) > 0;)
        behind += static_cast<std::uint64_t>(count);
    const Int3 size = header.placement.size;
    if (behind >= static_cast<std::uint64_t>(size.x) * static_cast<std::uint64_t>(size.y) *
                      bytes_of(header.component))
        volume.warnings.push_back(
            "the file holds " + std::to_string(behind) +
            " bytes more than its header asks for: check size and type of its voxels (dim, "
            "datatype), or write it again");
    int status = Z_OK;  // of the whole stream: its checksum comes last
    gzerror(file.get(), &status);
    if (status != Z_OK && status != Z_STREAM_END)
        return Error{"damaged compression", path, kCutOff};
    if (header.swapped) swap_bytes(volume.bytes, bytes_of(volume.component));
    return volume;
}

// After the header come four bytes of which the first says whether extensions follow; each is its
// size (with these eight bytes), a code and its content, up to where the voxels begin.
Result<LabelTable> load_nifti_label_table(const std::string& path, Orientation orientation) {
    constexpr std::int32_t kMax = 16 << 20;
    const GzFile file(gzopen(path.c_str(), "rb"));
    if (!file) return LabelTable{};
    const auto header = parse_nifti_header(first_bytes(file.get()), path, orientation);
    if (!header || !header->has_extensions) return LabelTable{};
    std::int64_t at = header->bytes + 4;
    while (at + 8 <= header->voxels_at) {
        std::uint8_t head[8];
        if (!read_bytes(file.get(), head, 8)) break;
        const std::int32_t length = int_at(head, header->swapped);
        if (length < 8 || length > kMax || at + length > header->voxels_at) break;
        std::string content(static_cast<std::size_t>(length) - 8, '\0');
        if (!read_bytes(file.get(), content.data(), content.size())) break;
        at += length;
        SONOCASE_TRY(auto table, parse_label_xml(content, path));
        if (!table.empty()) return table;
    }
    return LabelTable{};
}

}  // namespace sonocase::pipeline::inline import_volume
