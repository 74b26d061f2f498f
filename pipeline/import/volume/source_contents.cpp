// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/source_contents.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "formats/text/excerpt.h"
#include "pipeline/anatomy/anatomy_check.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/import/volume/dicom_frames.h"
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

std::string paths_below(const std::string& folder, const std::vector<DicomObject>& objects) {
    std::vector<std::string> paths;
    for (const DicomObject& object : objects) paths.push_back(path_below(folder, object.path));
    return excerpt(paths);
}

Result<SourceContents> dicom_contents(const DicomFolder& folder, const std::string& path) {
    if (const std::string both = two_patients(folder, path); !both.empty())
        return Error{"holds files of two patients, such as " + both, path,
                     "give the folder of one patient"};
    if (folder.segmentations.size() > 1)
        return Error{"holds " + std::to_string(folder.segmentations.size()) +
                         " DICOM segmentations: " + paths_below(path, folder.segmentations),
                     path, "give one of them by its own path, and the CT with --scan"};
    SourceContents found;
    if (!folder.slices.empty()) {
        const bool mr = folder.slices.front().modality == "MR";
        found.scan = path;
        found.scan_kind = std::to_string(folder.slices.size()) + (mr ? " MR" : " CT") + " slices";
    }
    if (!folder.segmentations.empty()) {
        found.labels = folder.slices.empty() ? folder.segmentations.front().path : path;
        found.labels_kind = "DICOM segmentation " + name_of(folder.segmentations.front().path);
    } else if (!folder.slices.empty()) {
        SONOCASE_TRY(const bool labels, holds_labels(path));
        if (labels) {
            found.labels = std::exchange(found.scan, "");
            found.labels_kind = std::to_string(folder.slices.size()) + " slices of label values";
        }
    } else if (!folder.structure_sets.empty()) {
        return Error{"a DICOM structure set (RTSTRUCT): contours, which are not read",
                     folder.structure_sets.front().path,
                     "make a DICOM segmentation or masks of it, such as in 3D Slicer"};
    }
    for (const std::string& other : series_texts(folder.other_slices))
        found.left_out.push_back(other + ", on which the segmentation was not drawn");
    if (!folder.others.empty()) found.left_out.push_back(objects_text(folder.others));
    return found;
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
    bool other_files = false;
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
        else
            listing.other_files = true;
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

Result<SourceContents> folder_contents(const std::string& path, int depth) {
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
    if (listing.volumes.empty()) {
        const DicomFolder dicom = read_dicom_headers(path);
        if (!dicom.slices.empty() || !dicom.segmentations.empty() || !dicom.structure_sets.empty())
            return dicom_contents(dicom, path);
        if (!dicom.others.empty())
            return Error{"holds neither labels nor a scan: " + objects_text(dicom.others), path,
                         kExpected};
    }
    constexpr int kDeepest = 3;
    if (depth < kDeepest)
        for (const std::string& folder : listing.folders) {
            SONOCASE_TRY(const auto one, folder_contents(folder, depth + 1));
            SONOCASE_TRY_DONE(add(one, path, found));
        }
    return found;
}

}  // namespace

Result<SourceContents> contents_of(const std::string& path) {
    std::error_code code;
    if (!fs::exists(path, code)) return Error{"no such file or folder", path, kExpected};
    Result<SourceContents> found = SourceContents{};
    if (fs::is_directory(path, code)) {
        found = folder_contents(path, 0);
    } else {
        SONOCASE_TRY_DONE(check_source_file(path, kExpected));
        found = is_dicom_file(path) ? dicom_contents(read_dicom_headers(path), path)
                                    : file_contents(path);
    }
    if (found && found->labels.empty() && found->scan.empty())
        return Error{"holds nothing that is known here", path, kExpected};
    return found;
}

}  // namespace sonocase::pipeline::inline import_volume
