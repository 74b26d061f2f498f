// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/source_contents.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "formats/text/excerpt.h"
#include "pipeline/anatomy/anatomy_check.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/import/volume/dicom_frames.h"
#include "pipeline/import/volume/dicom_segmentation.h"
#include "pipeline/import/volume/dicom_series.h"
#include "pipeline/import/volume/native_volume.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline::inline import_volume {

namespace {

namespace fs = std::filesystem;

constexpr const char* kExpected =
    "expected a DICOM folder with a segmentation, a folder of masks, or a label map as NIfTI, NRRD "
    "or MetaImage, with its CT where there is one";

std::string name_of(const std::string& path) {
    return fs::path(path).filename().string();
}

// "ST1/SEG/IM1": on a disc all may have one name.
std::string path_below(const std::string& folder, const std::string& path) {
    return fs::path(path).lexically_relative(folder).generic_string();
}

// Two files of different patients, named by their paths below the folder; empty: all are of one.
// IDs alone do not tell: anonymised copies of one examination may have two.
std::string two_patients(const DicomFolder& folder, const std::string& path) {
    struct Owner {
        const std::string *path, *patient, *frame;
    };
    std::vector<Owner> owners;
    for (const auto* slices : {&folder.slices, &folder.other_slices})
        for (const DicomSlice& s : *slices)
            owners.push_back({&s.path, &s.patient, &s.frame_of_reference});
    for (const DicomObject& s : folder.segmentations)
        owners.push_back({&s.path, &s.patient, &s.frame_of_reference});
    for (const Owner& one : owners) {
        const Owner& first = owners.front();
        if (first.patient->empty() || one.patient->empty() || *first.patient == *one.patient)
            continue;
        if (!first.frame->empty() && *first.frame == *one.frame) continue;
        return path_below(path, *first.path) + " and " + path_below(path, *one.path);
    }
    return "";
}

// The deepest folder that holds all files.
std::string common_folder(const std::vector<std::string>& files) {
    fs::path common = fs::path(files.front()).parent_path();
    for (const std::string& file : files)
        while (!file.starts_with((common / "").string()) && common.has_relative_path())
            common = common.parent_path();
    return common.string();
}

bool holds_volumes(const std::string& folder) {
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(folder, code))
        if (is_volume_file_name(entry.path().string()) &&
            !entry.path().filename().string().starts_with('.'))
            return true;
    return false;
}

Result<SourceContents> dicom_contents(const DicomFolder& folder, const std::string& path) {
    if (const std::string both = two_patients(folder, path); !both.empty())
        return Error{"holds files of two patients, such as " + both, path,
                     "give the folder of one patient"};
    const auto& labels = folder.segmentations;
    if (labels.size() > 1)
        if (const auto joined = grid_of_segmentations(paths_of(labels), 0, true); !joined)
            return Error{"holds " + joined.error().what, path,
                         "give one of them by its own path, and the CT with --scan"};
    std::error_code code;
    SourceContents found;
    // The folder of what is taken, without what lies beside it.
    std::vector<std::string> files = paths_of(labels);
    if (!folder.slices.empty()) {
        SONOCASE_TRY(const auto stack, dicom_stack(folder.slices, path, {true, labels}));
        for (const DicomSlice& slice : stack.slices) files.push_back(slice.path);
        const DicomSlice& first = stack.slices.front();
        const auto gaps = std::count_if(stack.slices.begin(), stack.slices.end(),
                                        [](const DicomSlice& s) { return s.between; });
        found.scan = path;
        found.scan_kind = std::to_string(std::ssize(stack.slices) - gaps) +
                          (first.modality == "MR" ? " MR" : " CT") + " slices";
        found.shear_deg = shear_deg(stack);
        for (const std::string& other : series_texts(stack.others))
            found.left_out.push_back(other + ", another series");
    }
    const std::string inside =
        fs::is_directory(path, code) && !files.empty() ? common_folder(files) : path;
    if (!found.scan.empty()) found.scan = inside;
    if (!labels.empty()) {
        found.labels = labels.size() == 1 && (folder.slices.empty() || holds_volumes(inside))
                           ? labels.front().path
                           : inside;
        if (found.labels == inside && holds_volumes(inside))
            return Error{"holds DICOM segmentations among other volumes", inside,
                         "put the segmentations into a folder of their own"};
        found.labels_kind = labels.size() == 1
                                ? "DICOM segmentation " + name_of(labels.front().path)
                                : std::to_string(labels.size()) + " DICOM segmentations";
    } else if (!folder.slices.empty()) {
        SONOCASE_TRY(const bool hold_labels, slices_hold_labels(folder, path));
        if (hold_labels) {
            found.labels = std::exchange(found.scan, "");
            found.labels_kind = std::to_string(folder.slices.size()) + " slices of label values";
        }
    }
    for (const std::string& other : series_texts(folder.other_slices))
        found.left_out.push_back(other + ", on which the segmentation was not drawn");
    if (!folder.structure_sets.empty())
        found.left_out.push_back(objects_text(folder.structure_sets) + ", contours");
    if (!folder.others.empty()) found.left_out.push_back(objects_text(folder.others));
    return found;
}

// DICOM files that give no labels, where nothing else does.
Status check_dicom(const DicomFolder& folder,
                   const SourceContents& found,
                   const std::string& path) {
    if (!found.labels.empty()) return Done{};
    if (!folder.structure_sets.empty())
        return Error{"a DICOM structure set (RTSTRUCT): contours, which are not read",
                     folder.structure_sets.front().path,
                     "make a DICOM segmentation or masks of it, such as in 3D Slicer"};
    if (found.scan.empty() && !folder.others.empty())
        return Error{"holds neither labels nor a scan: " + objects_text(folder.others), path,
                     kExpected};
    return Done{};
}

// What several parts hold together. Errors: more than one of a kind.
Status add(const SourceContents& part, const std::string& path, SourceContents& all) {
    if (!part.labels.empty() && !all.labels.empty())
        return Error{"holds several label maps, such as " + name_of(all.labels) + " and " +
                         name_of(part.labels),
                     path, "give one of them by its own path, and the CT with --scan"};
    if (!part.scan.empty() && !all.scan.empty())
        return Error{
            "holds several scans, such as " + name_of(all.scan) + " and " + name_of(part.scan),
            path, "give the labels by their own path, and their CT with --scan"};
    if (!part.labels.empty()) {
        all.labels = part.labels;
        all.labels_kind = part.labels_kind;
    }
    if (!part.scan.empty()) {
        all.scan = part.scan;
        all.scan_kind = part.scan_kind;
    }
    if (part.shear_deg > 0) {
        all.shear_deg = part.shear_deg;
    }
    all.left_out.insert(all.left_out.end(), part.left_out.begin(), part.left_out.end());
    return Done{};
}

Result<SourceContents> file_contents(const std::string& path) {
    SourceContents found;
    SONOCASE_TRY(const bool labels, holds_labels(path));
    (labels ? found.labels : found.scan) = path;
    (labels ? found.labels_kind : found.scan_kind) = labels ? "label map" : "scan";
    return found;
}

struct Listing {
    std::vector<std::string> volumes, folders;
};

Listing list(const std::string& path) {
    Listing listing;
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(path, code)) {
        const std::string name = entry.path().filename().string();
        if (name.starts_with('.')) continue;
        if (entry.is_directory(code))
            listing.folders.push_back(entry.path().string());
        else if (is_volume_file_name(name))
            listing.volumes.push_back(entry.path().string());
    }
    std::sort(listing.volumes.begin(), listing.volumes.end());  // in no fixed order on disk
    std::sort(listing.folders.begin(), listing.folders.end());
    return listing;
}

// A folder whose volume files are mostly named as structures holds masks.
bool are_masks(const std::vector<std::string>& volumes) {
    std::size_t known = 0;
    for (const std::string& file : volumes) known += is_known_structure(volume_stem(file));
    return volumes.size() > 1 && 2 * known >= volumes.size();
}

// Volume files, in the folder and below.
Result<SourceContents> volume_contents(const std::string& path, int depth) {
    const Listing listing = list(path);
    SourceContents found;
    if (are_masks(listing.volumes)) {
        found.labels = path;
        found.labels_kind = "folder of " + std::to_string(listing.volumes.size()) + " masks";
        return found;
    }
    for (const std::string& file : listing.volumes) {
        SONOCASE_TRY(const auto one, file_contents(file));
        SONOCASE_TRY_DONE(add(one, path, found));
    }
    constexpr int kDeepest = 3;
    if (depth < kDeepest)
        for (const std::string& folder : listing.folders) {
            SONOCASE_TRY(const auto one, volume_contents(folder, depth + 1));
            SONOCASE_TRY_DONE(add(one, path, found));
        }
    return found;
}

Result<SourceContents> folder_contents(const std::string& path) {
    SONOCASE_TRY(auto found, volume_contents(path, 0));
    const DicomFolder dicom = read_dicom_headers(path);
    SONOCASE_TRY(const auto part, dicom_contents(dicom, path));
    SONOCASE_TRY_DONE(add(part, path, found));
    SONOCASE_TRY_DONE(check_dicom(dicom, found, path));
    return found;
}

Result<SourceContents> dicom_file_contents(const std::string& path) {
    const DicomFolder dicom = read_dicom_headers(path);
    SONOCASE_TRY(const auto found, dicom_contents(dicom, path));
    SONOCASE_TRY_DONE(check_dicom(dicom, found, path));
    return found;
}

}  // namespace

Result<SourceContents> contents_of(const std::string& path) {
    std::error_code code;
    if (!fs::exists(path, code)) return Error{"no such file or folder", path, kExpected};
    Result<SourceContents> found = SourceContents{};
    if (fs::is_directory(path, code)) {
        found = folder_contents(path);
    } else {
        SONOCASE_TRY_DONE(check_source_file(path, kExpected));
        found = is_dicom_file(path) ? dicom_file_contents(path) : file_contents(path);
    }
    if (found && found->labels.empty() && found->scan.empty())
        return Error{"holds nothing that is known here", path, kExpected};
    return found;
}

}  // namespace sonocase::pipeline::inline import_volume
