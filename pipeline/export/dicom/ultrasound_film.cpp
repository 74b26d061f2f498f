// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/dicom/ultrasound_film.h"

#include <png.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "formats/files/recording_file.h"
#include "formats/recording/session.h"
#include "formats/text/number_text.h"

namespace sonocase::pipeline {
namespace {

using nlohmann::json;

constexpr std::size_t kMostBytes = std::size_t{1} << 31;  // of a film, as DICOM can hold it

std::string pictures_beside(const std::string& path) {
    for (const std::string ending : {".igs.mha", ".igs.nrrd", ".mha"}) {
        if (path.size() > ending.size() &&
            path.compare(path.size() - ending.size(), ending.size(), ending) == 0)
            return path.substr(0, path.size() - ending.size()) + ".frames.igs.mha";
    }
    return path + ".frames.igs.mha";
}

std::string field(const std::vector<SequenceField>& fields, const std::string& name) {
    for (const SequenceField& f : fields) {
        if (f.name == name) return f.value;
    }
    return "";
}

double number(const std::string& text) {
    double value = 0;
    return parse_number(text, value) ? value : 0;
}

void take_header(const Sequence& sequence, const std::string& path, UltrasoundFilm& film) {
    const auto session = session_from_sequence(sequence, guess_names(sequence), path);
    if (!session) return;  // a recording of another program: it has pictures all the same
    film.case_name = session->header.case_name;
    film.exercise = session->header.exercise;
    film.program = session->header.program;
    film.started = session->header.started;
}

Status take_pictures(const Sequence& sequence, const std::string& path, UltrasoundFilm& film) {
    if (sequence.element != "MET_UCHAR" || sequence.depth != 1 ||
        (sequence.channels != 1 && sequence.channels != 3))
        return Error{"the pictures are of a kind that is not written as ultrasound", path,
                     "8 bits, one or three channels"};
    film.width_px = sequence.width;
    film.height_px = film.picture_height_px = sequence.height;
    film.channels = sequence.channels;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
        const SequenceFrame& frame = sequence.frames[i];
        // Pictures of another depth would have another scale than the file can say.
        const double mm_per_px = number(field(frame.fields, "MmPerPx"));
        if (film.times_s.empty()) {
            film.mm_per_px = mm_per_px;
            film.origin_x_px = number(field(frame.fields, "OriginXPx"));
            film.origin_y_px = number(field(frame.fields, "OriginYPx"));
        } else if (mm_per_px != film.mm_per_px || !(frame.timestamp_s > film.times_s.back())) {
            continue;
        }
        film.times_s.push_back(frame.timestamp_s);
        const auto from =
            sequence.pixels.begin() + static_cast<std::ptrdiff_t>(i * sequence.frame_bytes());
        film.pixels.insert(film.pixels.end(), from,
                           from + static_cast<std::ptrdiff_t>(sequence.frame_bytes()));
    }
    return Done{};
}

Status add_png(const std::string& path, UltrasoundFilm& film) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&image, path.c_str()))
        return Error{std::string("cannot read the picture: ") + image.message, path, "a PNG"};
    const int channels = (image.format & PNG_FORMAT_FLAG_COLOR) != 0 ? 3 : 1;
    image.format = channels == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
    const int width = static_cast<int>(image.width), height = static_cast<int>(image.height);
    if (film.pixels.empty()) {
        film.width_px = width;
        film.height_px = height;
        film.channels = channels;
    }
    if (width != film.width_px || height != film.height_px || channels != film.channels ||
        film.pixels.size() + film.frame_bytes() > kMostBytes) {
        png_image_free(&image);
        return Error{"the pictures have several sizes, or are too many for one file", path,
                     "pictures of one run, at most 2 GB"};
    }
    const std::size_t at = film.pixels.size();
    film.pixels.resize(at + film.frame_bytes());
    if (!png_image_finish_read(&image, nullptr, film.pixels.data() + at, 0, nullptr))
        return Error{std::string("cannot read the picture: ") + image.message, path, "a whole PNG"};
    return Done{};
}

Result<UltrasoundFilm> film_of_folder(const std::string& folder) {
    UltrasoundFilm film;
    std::vector<std::string> files;
    std::error_code failed;
    for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
        const std::string name = entry.path().filename().string();
        if (name.rfind("frame_", 0) == 0 && entry.path().extension() == ".png")
            files.push_back(entry.path().string());
    }
    if (failed) return Error{"cannot read the folder: " + failed.message(), folder, ""};
    std::sort(files.begin(), files.end());
    for (const std::string& file : files) {
        if (Status added = add_png(file, film); !added) return added.error();
    }
    film.picture_height_px = film.height_px;
    json about;
    if (const auto text = read_text_file(folder + "/pictures.json"))
        about = json::parse(*text, nullptr, false);
    const auto value = [&](const char* key) {
        return about.is_object() && about.contains(key) && about[key].is_number()
                   ? about[key].get<double>()
                   : 0.0;
    };
    const auto words = [&](const char* key) {
        return about.is_object() && about.contains(key) && about[key].is_string()
                   ? about[key].get<std::string>()
                   : std::string();
    };
    film.mm_per_px = value("mm_per_px");
    film.origin_x_px = value("origin_x_px");
    film.origin_y_px = value("origin_y_px");
    film.program = words("program");
    film.case_name = words("case");
    film.exercise = words("exercise");
    const double height = value("picture_height_px");
    if (height >= 1 && height <= film.height_px) film.picture_height_px = static_cast<int>(height);
    const double rate = value("frames_per_s") > 0 ? value("frames_per_s") : 60;
    for (std::size_t i = 0; i < files.size(); ++i)
        film.times_s.push_back(static_cast<double>(i) / rate);
    return film;
}

}  // namespace

Result<UltrasoundFilm> film_of_session(const std::string& path) {
    std::error_code ignored;
    Result<UltrasoundFilm> film = UltrasoundFilm{};
    if (std::filesystem::is_directory(path, ignored)) {
        film = film_of_folder(path);
        if (!film) return film;
    } else {
        const auto sequence = load_sequence(path);
        if (!sequence) return sequence.error();
        take_header(*sequence, path, *film);
        const bool own = sequence->width > 1 && sequence->height > 1;
        const std::string beside = pictures_beside(path);
        if (own) {
            if (Status taken = take_pictures(*sequence, path, *film); !taken) return taken.error();
        } else if (std::filesystem::exists(beside, ignored)) {
            const auto pictures = load_sequence(beside);
            if (!pictures) return pictures.error();
            if (Status taken = take_pictures(*pictures, beside, *film); !taken)
                return taken.error();
        }
    }
    if (film->times_s.empty())
        return Error{"there are no pictures", path,
                     "a recording with pictures, or a folder that sonoplay BUNDLE --headless "
                     "--tracker replay:SESSION --out FOLDER has written"};
    return film;
}

}  // namespace sonocase::pipeline
