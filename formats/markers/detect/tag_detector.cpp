// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/detect/tag_detector.h"

#include <algorithm>
#include <cmath>

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#ifndef __EMSCRIPTEN__
#include <dlfcn.h>
#endif

#include "formats/markers/marker_set.h"

namespace sonocase {
namespace {

// The functions of libapriltag that are called.
struct Library {
    decltype(&tag36h11_create) family_create = nullptr;
    decltype(&tag36h11_destroy) family_destroy = nullptr;
    decltype(&apriltag_detector_create) create = nullptr;
    decltype(&apriltag_detector_destroy) destroy = nullptr;
    decltype(&apriltag_detector_add_family_bits) add_family = nullptr;
    decltype(&apriltag_detector_detect) detect = nullptr;
    decltype(&apriltag_detections_destroy) detections_destroy = nullptr;
    bool complete = false;
};

#ifdef __EMSCRIPTEN__

// A page's program has no libraries beside it: this one is linked in.
const Library& library() {
    static const Library linked = {tag36h11_create,
                                   tag36h11_destroy,
                                   apriltag_detector_create,
                                   apriltag_detector_destroy,
                                   apriltag_detector_add_family_bits,
                                   apriltag_detector_detect,
                                   apriltag_detections_destroy,
                                   true};
    return linked;
}

#else

template <class Function>
bool find(void* library, const char* name, Function& function) {
    function = reinterpret_cast<Function>(dlsym(library, name));
    return function != nullptr;
}

// Opened once, never closed.
const Library& library() {
    static const Library opened = [] {
        Library l;
        void* handle = dlopen("libapriltag.so.3", RTLD_NOW | RTLD_LOCAL);
        if (!handle) return l;
        l.complete = find(handle, "tag36h11_create", l.family_create) &&
                     find(handle, "tag36h11_destroy", l.family_destroy) &&
                     find(handle, "apriltag_detector_create", l.create) &&
                     find(handle, "apriltag_detector_destroy", l.destroy) &&
                     find(handle, "apriltag_detector_add_family_bits", l.add_family) &&
                     find(handle, "apriltag_detector_detect", l.detect) &&
                     find(handle, "apriltag_detections_destroy", l.detections_destroy);
        return l;
    }();
    return opened;
}

#endif

}  // namespace

struct TagDetector::State {
    apriltag_family_t* family = nullptr;
    apriltag_detector_t* detector = nullptr;
    std::vector<std::uint8_t> mirrored;

    ~State() {
        if (detector) library().destroy(detector);
        if (family) library().family_destroy(family);
    }

    // Adds every tag that is read with certainty.
    void read(const GreyPicture& picture,
              const PictureRegion& region,
              int step,
              double blur,
              std::vector<SeenTag>& tags) {
        const int x0 = std::max(0, region.x0), y0 = std::max(0, region.y0);
        const int width = std::min(picture.width_px, region.x1) - x0;
        const int height = std::min(picture.height_px, region.y1) - y0;
        constexpr int kMinSide = 16;  // pixels
        if (width < kMinSide || height < kMinSide) return;
        // The library does not write into the picture.
        image_u8_t image = {width, height, picture.stride,
                            const_cast<std::uint8_t*>(picture.pixels) +
                                static_cast<std::ptrdiff_t>(y0) * picture.stride + x0};
        detector->quad_decimate = static_cast<float>(step);
        detector->quad_sigma = static_cast<float>(blur);
        zarray_t* found = library().detect(detector, &image);
        for (int i = 0; i < zarray_size(found); ++i) {
            apriltag_detection_t* seen = nullptr;
            zarray_get(found, i, &seen);
            // Below this the cells are hardly told apart: noise reads as a tag now and then.
            constexpr float kMinMargin = 12;
            if (seen->decision_margin < kMinMargin) continue;
            SeenTag tag;
            tag.id = seen->id;
            tag.corrected = seen->hamming;
            // The library's first pixel has its middle at (0.5, 0.5).
            for (int k = 0; k < 4; ++k)
                tag.corners[k] = {seen->p[k][0] - 0.5 + x0, seen->p[k][1] - 0.5 + y0};
            tags.push_back(tag);
        }
        library().detections_destroy(found);
    }
};

namespace {

constexpr int kFindStep = 2, kSearchStep = 3;  // pixels
constexpr double kSharp = 0;

PictureRegion whole(const GreyPicture& picture) {
    return {0, 0, picture.width_px, picture.height_px};
}

int area_of(const PictureRegion& region) {
    return (region.x1 - region.x0) * (region.y1 - region.y0);
}

Pixel middle_of(const SeenTag& tag) {
    Pixel sum;
    for (const Pixel& c : tag.corners) sum.x += 0.25 * c.x, sum.y += 0.25 * c.y;
    return sum;
}
double way(Pixel a, Pixel b) {
    return std::hypot(a.x - b.x, a.y - b.y);
}
double diagonal_of(const SeenTag& tag) {
    return std::max(way(tag.corners[0], tag.corners[2]), way(tag.corners[1], tag.corners[3]));
}

// Sorted by id, each place once; ids in two places go to `twice` and stay.
void sort_by_id(std::vector<SeenTag>& tags, std::vector<int>& twice) {
    std::stable_sort(tags.begin(), tags.end(),
                     [](const SeenTag& a, const SeenTag& b) { return a.id < b.id; });
    std::size_t kept = 0;
    for (const SeenTag& tag : tags) {
        if (kept > 0 && tags[kept - 1].id == tag.id) {
            const bool same =
                way(middle_of(tags[kept - 1]), middle_of(tag)) < 0.5 * diagonal_of(tag);
            if (!same && (twice.empty() || twice.back() != tag.id)) twice.push_back(tag.id);
            continue;
        }
        tags[kept++] = tag;
    }
    tags.resize(kept);
}

}  // namespace

TagDetector::TagDetector(std::unique_ptr<State> state) : state_(std::move(state)) {}
TagDetector::TagDetector(TagDetector&&) noexcept = default;
TagDetector& TagDetector::operator=(TagDetector&&) noexcept = default;
TagDetector::~TagDetector() = default;

Result<TagDetector> TagDetector::create() {
    if (!library().complete) {
        return Error{"the library that finds printed tags is not installed", "libapriltag.so.3",
                     "install it: apt install libapriltag3"};
    }
    auto state = std::make_unique<State>();
    state->family = library().family_create();
    state->detector = library().create();
    // One wrong cell is corrected: two would let five times as much noise pass as a tag.
    library().add_family(state->detector, state->family, 1);
    state->detector->nthreads = 1;
    state->detector->quad_decimate = 2;
    state->detector->refine_edges = true;
    state->detector->decode_sharpening = 0.25;
    return TagDetector(std::move(state));
}

TagFindings TagDetector::find(const GreyPicture& picture) {
    TagFindings out;
    std::vector<SeenTag> tags;
    state_->read(picture, whole(picture), kFindStep, kSharp, tags);
    sort_by_id(tags, out.twice);
    for (SeenTag& tag : tags) {
        if (std::binary_search(out.twice.begin(), out.twice.end(), tag.id)) continue;
        if (tag.id < kMarkerTagIds && fit_tag(picture, tag)) {
            out.tags.push_back(tag);
        } else {
            ++out.unrefined;
        }
    }
    return out;
}

void TagDetector::read(const GreyPicture& picture,
                       const PictureRegion& region,
                       int step,
                       std::vector<SeenTag>& tags,
                       double blur) {
    state_->read(picture, region, step, blur, tags);
}

int TagDetector::count_mirrored(const GreyPicture& picture) {
    const std::size_t width = picture.width_px, height = picture.height_px;
    state_->mirrored.resize(width * height);
    for (std::size_t y = 0; y < height; ++y) {
        const std::uint8_t* row = picture.pixels + y * picture.stride;
        std::reverse_copy(row, row + width, state_->mirrored.begin() + y * width);
    }
    const GreyPicture mirrored{state_->mirrored.data(), picture.width_px, picture.height_px,
                               picture.width_px};
    std::vector<SeenTag> tags;
    state_->read(mirrored, whole(mirrored), kFindStep, kSharp, tags);
    return static_cast<int>(tags.size());
}

PictureFollower::PictureFollower(TagDetector detector, MarkerFollower follower)
    : detector_(std::move(detector)), follower_(std::move(follower)) {
    twice_until_.fill(-1);
    if (const MarkerBody* board = follower_.body(MarkerRole::board)) {
        const std::size_t count = board->tags.size();
        std::vector<double> gap(count, 1e9);
        std::size_t next = 0;
        for (std::size_t k = 0; k < count; ++k) {
            board_order_.push_back(static_cast<int>(next));
            const Point3 at = board->tags[next].body_from_tag * Point3{};
            for (std::size_t t = 0; t < count; ++t)
                gap[t] = std::min(gap[t], distance(at, board->tags[t].body_from_tag * Point3{}));
            next = static_cast<std::size_t>(std::max_element(gap.begin(), gap.end()) - gap.begin());
        }
    }
}

// A board that stands where it stood needs no search: its pattern is laid over the picture there.
void PictureFollower::look_at_board(const GreyPicture& picture) {
    constexpr int kEnough = 8, kTried = 12, kFewPixels = 250;
    const MarkerBody* board = follower_.body(MarkerRole::board);
    const std::optional<Rigid> pose = follower_.expected_board();
    if (!board || !pose) return;
    const auto corners_of = [&](const MarkerTag& tag, SeenTag& at) {
        at.id = tag.id;
        const std::array<Point3, 4> corners = tag_corners(tag);
        for (int k = 0; k < 4; ++k) {
            if (!project(follower_.camera(), *pose * corners[k] - Point3{}, at.corners[k], nullptr))
                return false;
            if (!(at.corners[k].x > 1 && at.corners[k].y > 1 &&
                  at.corners[k].x < picture.width_px - 2 &&
                  at.corners[k].y < picture.height_px - 2))
                return false;
        }
        return true;
    };
    int tried = 0;
    PictureRegion around{picture.width_px, picture.height_px, 0, 0};
    for (const int index : board_order_) {
        SeenTag tag;
        if (!corners_of(board->tags[index], tag)) continue;
        for (const Pixel& c : tag.corners) {
            around.x0 = std::min(around.x0, static_cast<int>(c.x));
            around.y0 = std::min(around.y0, static_cast<int>(c.y));
            around.x1 = std::max(around.x1, static_cast<int>(c.x));
            around.y1 = std::max(around.y1, static_cast<int>(c.y));
        }
        if (tried >= kTried || fitted_.size() >= kEnough) continue;
        ++tried;
        if (fit_tag(picture, tag, kFewPixels)) {
            unbend_tag(follower_.camera(), tag);
            fitted_.push_back(tag);
        }
    }
    // Otherwise the camera or the board has moved, or most of it is hidden.
    constexpr std::size_t kHeld = 4;
    constexpr int kMoved = 40;  // pixels
    if (fitted_.size() >= kHeld || tried < static_cast<int>(kHeld)) return;
    detector_.read(picture,
                   {around.x0 - kMoved, around.y0 - kMoved, around.x1 + kMoved, around.y1 + kMoved},
                   kSearchStep, raw_);
}

void PictureFollower::look_at_tool(const GreyPicture& picture,
                                   MarkerRole role,
                                   const Rigid& camera_from_body) {
    constexpr double kMargin = 30;  // pixels: what a hand does beside going on as it did
    double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
    for (const MarkerFace& face : follower_.body(role)->faces)
        for (const Point3& corner : face.corners) {
            Pixel p;
            if (!project(follower_.camera(), camera_from_body * corner - Point3{}, p, nullptr))
                return;
            x0 = std::min(x0, p.x), x1 = std::max(x1, p.x);
            y0 = std::min(y0, p.y), y1 = std::max(y1, p.y);
        }
    if (!(x1 > 0 && y1 > 0 && x0 < picture.width_px && y0 < picture.height_px)) return;
    const auto clamped = [](double at, int high) {
        return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(high)));
    };
    const PictureRegion region{
        clamped(x0 - kMargin, picture.width_px), clamped(y0 - kMargin, picture.height_px),
        clamped(x1 + kMargin, picture.width_px), clamped(y1 + kMargin, picture.height_px)};
    look_at(picture, region);
}

void PictureFollower::look_at(const GreyPicture& picture, const PictureRegion& region) {
    constexpr int kSmall = 160 * 160;  // pixels: every one of them is looked at
    detector_.read(picture, region, area_of(region) <= kSmall ? 1 : kFindStep, raw_);
    remember(picture, region);
}

// Where the rest of a body is whose first tags are read; nothing: none is.
std::optional<PictureRegion> PictureFollower::around_tags(MarkerRole role,
                                                          const GreyPicture& picture) const {
    PictureRegion around{picture.width_px, picture.height_px, 0, 0};
    for (const SeenTag& tag : raw_) {
        const TagPlace place = find_tag(follower_.bodies(), tag.id);
        if (place.body < 0 || follower_.bodies()[place.body].role != role) continue;
        const Pixel middle = middle_of(tag);
        const double reach = 2.5 * diagonal_of(tag) + 10;
        around.x0 = std::min(around.x0, static_cast<int>(middle.x - reach));
        around.y0 = std::min(around.y0, static_cast<int>(middle.y - reach));
        around.x1 = std::max(around.x1, static_cast<int>(middle.x + reach));
        around.y1 = std::max(around.y1, static_cast<int>(middle.y + reach));
    }
    const PictureRegion within{std::max(0, around.x0), std::max(0, around.y0),
                               std::min(picture.width_px, around.x1),
                               std::min(picture.height_px, around.y1)};
    // Tags on both sides of the picture are on no one body.
    if (within.x1 <= within.x0 || area_of(within) > area_of(whole(picture)) / 3) return {};
    return within;
}

bool PictureFollower::seen(MarkerRole role, int tags) const {
    const auto is_in = [](const std::vector<SeenTag>& list, int id) {
        return std::any_of(list.begin(), list.end(), [&](const SeenTag& t) { return t.id == id; });
    };
    for (const MarkerTag& drawn : follower_.body(role)->tags)
        tags -= is_in(raw_, drawn.id) || is_in(fitted_, drawn.id);
    return tags <= 0;
}

// A tag that is in view twice need not be so within one searched part: it then seems to leap.
void PictureFollower::note_twice() {
    constexpr std::int64_t kRemembered = 15, kLeapPictures = 4;
    constexpr double kLeapPx = 80;  // in one picture; a body that is moved at 1 m/s at 0.4 m
    for (const int id : twice_)
        if (id < kMarkerTagIds) twice_until_[id] = picture_ + kRemembered;
    for (const SeenTag& tag : raw_) {
        // A board is laid over the picture where it was; a second one shows beside it.
        const TagPlace bearer = find_tag(follower_.bodies(), tag.id);
        if (bearer.body < 0 || follower_.bodies()[bearer.body].role == MarkerRole::board) continue;
        Place& place = places_[tag.id];
        const Pixel middle = middle_of(tag);
        const std::int64_t age = picture_ - place.picture;
        if (age <= kLeapPictures && way(place.middle, middle) > kLeapPx * static_cast<double>(age))
            twice_until_[tag.id] = picture_ + kRemembered;
        place = {middle, picture_};
    }
    for (int id = 0; id < kMarkerTagIds; ++id)
        if (twice_until_[id] >= picture_ && !std::binary_search(twice_.begin(), twice_.end(), id))
            twice_.insert(std::lower_bound(twice_.begin(), twice_.end(), id), id);
}

// One pixel of so many along both axes is compared, so that there are some 320 across.
int PictureFollower::sample_step(const GreyPicture& picture) {
    constexpr int kAcross = 320;
    return std::max(1, picture.width_px / kAcross);
}

void PictureFollower::remember(const GreyPicture& picture, const PictureRegion& region) {
    const int step = sample_step(picture);
    const int columns = (picture.width_px + step - 1) / step;
    const int rows = (picture.height_px + step - 1) / step;
    searched_.resize(static_cast<std::size_t>(columns) * rows);
    const int x0 = (std::max(0, region.x0) + step - 1) / step;
    const int y0 = (std::max(0, region.y0) + step - 1) / step;
    const int x1 = (std::min(picture.width_px, region.x1) + step - 1) / step;
    const int y1 = (std::min(picture.height_px, region.y1) + step - 1) / step;
    for (int y = y0; y < y1; ++y) {
        const std::uint8_t* row =
            picture.pixels + static_cast<std::ptrdiff_t>(y) * step * picture.stride;
        std::uint8_t* kept = searched_.data() + static_cast<std::ptrdiff_t>(y) * columns;
        for (int x = x0; x < x1; ++x) kept[x] = row[x * step];
    }
}

// Boxes round what no longer looks as it did when it was last searched: tiles of 20 x 20 samples
// that touch each other make one.
std::vector<PictureRegion> PictureFollower::changed(const GreyPicture& picture) const {
    constexpr int kTile = 20;
    // Lamps flicker by a twentieth and more, and cameras have noise: what differs by less than this
    // and an eighth of its brightness has not changed.
    constexpr int kMinDifference = 12, kFlicker = 8;
    constexpr int kFew = kTile * kTile / 40;  // samples; of a narrow tag there are sixteen
    const int step = sample_step(picture);
    const int columns = (picture.width_px + step - 1) / step;
    const int rows = (picture.height_px + step - 1) / step;
    const int across = (columns + kTile - 1) / kTile, down = (rows + kTile - 1) / kTile;
    std::vector<int> differ(static_cast<std::size_t>(across) * down);
    for (int y = 0; y < rows; ++y) {
        const std::uint8_t* row =
            picture.pixels + static_cast<std::ptrdiff_t>(y) * step * picture.stride;
        const std::uint8_t* kept = searched_.data() + static_cast<std::ptrdiff_t>(y) * columns;
        int* tiles = differ.data() + static_cast<std::ptrdiff_t>(y / kTile) * across;
        for (int tile = 0; tile < across; ++tile) {
            int count = 0;
            for (int x = tile * kTile; x < std::min(columns, (tile + 1) * kTile); ++x)
                count += std::abs(row[x * step] - kept[x]) > kMinDifference + kept[x] / kFlicker;
            tiles[tile] += count;
        }
    }
    std::vector<PictureRegion> boxes;
    std::vector<int> open;
    for (int first = 0; first < across * down; ++first) {
        if (differ[first] < kFew) continue;
        PictureRegion box{across, down, 0, 0};
        open.assign(1, first);
        differ[first] = 0;
        while (!open.empty()) {
            const int x = open.back() % across, y = open.back() / across;
            open.pop_back();
            box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x + 1),
                   std::max(box.y1, y + 1)};
            for (int v = std::max(0, y - 1); v <= std::min(down - 1, y + 1); ++v)
                for (int u = std::max(0, x - 1); u <= std::min(across - 1, x + 1); ++u) {
                    if (differ[v * across + u] < kFew) continue;
                    differ[v * across + u] = 0;
                    open.push_back(v * across + u);
                }
        }
        const int side = kTile * step;
        boxes.push_back({box.x0 * side, box.y0 * side, std::min(box.x1 * side, picture.width_px),
                         std::min(box.y1 * side, picture.height_px)});
    }
    return boxes;
}

// What changed since it was last searched is searched at once, for what was hidden and is shown
// changes the picture; and one cell of the picture after another, where change did not show it.
// Where more than a third changed, as where the camera moves, a third is searched, then the next.
void PictureFollower::search(const GreyPicture& picture) {
    constexpr int kOverlap = 40;  // pixels: a tag of 80 lies wholly within one of two neighbours
    constexpr int kAlign = 8;     // pixels: a tag is then read as it is in the whole picture
    // Noise and cloth have edges as well, most of which a blur before the search removes: half the
    // time, and of a hundred bodies that are found without it two are not.
    constexpr double kBlur = 0.8;  // in steps
    const auto grown = [&](const PictureRegion& r) {
        return PictureRegion{std::max(0, r.x0 - kOverlap) / kAlign * kAlign,
                             std::max(0, r.y0 - kOverlap) / kAlign * kAlign,
                             std::min(picture.width_px, r.x1 + kOverlap),
                             std::min(picture.height_px, r.y1 + kOverlap)};
    };
    const int all = area_of(whole(picture));
    std::vector<PictureRegion> regions = changed(picture);
    int area = 0;
    for (const PictureRegion& r : regions) area += area_of(grown(r));
    const double blur = area > all / 5 ? kBlur : kSharp;
    if (area > all / 3) {
        regions = {{0, picture.height_px * part_ / kParts, picture.width_px,
                    picture.height_px * (part_ + 1) / kParts}};
        part_ = (part_ + 1) % kParts;
    } else if (area <= all / 8) {
        const int column = cell_ % kCellsAcross, row = cell_ / kCellsAcross;
        regions.push_back({picture.width_px * column / kCellsAcross,
                           picture.height_px * row / kCellsDown,
                           picture.width_px * (column + 1) / kCellsAcross,
                           picture.height_px * (row + 1) / kCellsDown});
        cell_ = (cell_ + 1) % (kCellsAcross * kCellsDown);
    }
    for (const PictureRegion& part : regions) {
        const PictureRegion region = grown(part);
        std::erase_if(foreign_, [&](Pixel p) {
            return p.x >= region.x0 && p.y >= region.y0 && p.x < region.x1 && p.y < region.y1;
        });
        read_all(picture, region, blur);
        remember(picture, part);
    }
}

// Notes which of the tags are on none of our sheets.
void PictureFollower::read_all(const GreyPicture& picture,
                               const PictureRegion& region,
                               double blur) {
    const std::size_t before = raw_.size();
    detector_.read(picture, region, kFindStep, raw_, blur);
    for (std::size_t k = before; k < raw_.size(); ++k)
        if (find_tag(follower_.bodies(), raw_[k].id).body < 0)
            foreign_.push_back(middle_of(raw_[k]));
}

FollowerPicture PictureFollower::follow(const GreyPicture& picture, double time_s) {
    constexpr MarkerRole kTools[] = {MarkerRole::probe, MarkerRole::needle};
    constexpr int kSearchEvery = 4;   // pictures, while everything is in view
    constexpr int kEnoughTags = 2;    // of a body
    constexpr double kPauseS = 0.15;  // where a tool is by then is not known
    ++picture_;
    const bool begins = time_s - last_s_ > kPauseS || picture.width_px != width_px_ ||
                        picture.height_px != height_px_;
    last_s_ = time_s;
    width_px_ = picture.width_px, height_px_ = picture.height_px;
    if (begins) places_ = {};
    raw_.clear(), fitted_.clear(), twice_.clear();
    look_at_board(picture);
    bool missing = follower_.body(MarkerRole::board) && !seen(MarkerRole::board, 3);
    bool missed[2] = {};
    for (int t = 0; t < 2; ++t) {
        if (!follower_.body(kTools[t])) continue;
        if (const std::optional<Rigid> pose = follower_.expected(kTools[t], time_s))
            look_at_tool(picture, kTools[t], *pose);
        // Too few tags, or on no such body: it is not followed, and nothing there changes.
        if (unposed_[t] && !begins && !seen(kTools[t], 1)) look_at(picture, *unposed_[t]);
        missed[t] = !seen(kTools[t], kEnoughTags);
        missing = missing || missed[t];
    }
    if (begins) {
        foreign_.clear();
        read_all(picture, whole(picture), kSharp);
        remember(picture, whole(picture));
    } else if (missing || picture_ % kSearchEvery == 0) {
        search(picture);
        // The first tag of a body shows where to look more closely.
        for (int t = 0; t < 2; ++t)
            if (missed[t] && !seen(kTools[t], kEnoughTags))
                if (const auto around = around_tags(kTools[t], picture))
                    detector_.read(picture, *around, kFindStep, raw_);
    }
    any_tags_ = !raw_.empty() || !fitted_.empty();
    // Those that are laid over the picture already come first, and stay.
    const std::size_t laid = fitted_.size();
    std::vector<SeenTag> all(fitted_);
    all.insert(all.end(), raw_.begin(), raw_.end());
    sort_by_id(all, twice_);
    raw_ = all;
    note_twice();
    constexpr std::size_t kBoardTags = 8;
    std::size_t board_tags = laid;
    for (const int index : board_order_) {
        if (board_tags >= kBoardTags) break;
        const int id = follower_.body(MarkerRole::board)->tags[index].id;
        for (SeenTag& tag : raw_)
            if (tag.id == id && tag.contrast == 0 && fit_tag(picture, tag, 250)) {
                unbend_tag(follower_.camera(), tag);
                fitted_.push_back(tag);
                ++board_tags;
            }
    }
    for (SeenTag& tag : raw_) {
        const TagPlace place = find_tag(follower_.bodies(), tag.id);
        if (place.body < 0 || follower_.bodies()[place.body].role == MarkerRole::board) continue;
        if (std::binary_search(twice_.begin(), twice_.end(), tag.id)) continue;
        if (!fit_tag(picture, tag)) continue;
        unbend_tag(follower_.camera(), tag);
        fitted_.push_back(tag);
    }
    const FollowerPicture out =
        follower_.follow(fitted_, twice_, static_cast<int>(foreign_.size()), time_s);
    for (int t = 0; t < 2; ++t) {
        unposed_[t].reset();
        if (out.tools[t].status == MarkerStatus::lost)
            unposed_[t] = around_tags(kTools[t], picture);
    }
    return out;
}

}  // namespace sonocase
