// SPDX-License-Identifier: Apache-2.0

// Finds printed tags in grey pictures with libapriltag, refines their corners, and follows the
// bodies that bear them from picture to picture.
//
// The library is opened when the first detector is made, so that a player that follows another
// tracker needs neither it nor its memory. One detector serves one thread. No files, no clock.
#pragma once

#include <memory>
#include <vector>

#include "formats/base/result.h"
#include "formats/markers/marker_follower.h"

namespace sonocase {

struct TagFindings {
    std::vector<SeenTag> tags;  // by id; each id once
    std::vector<int> twice;     // ids that were seen in two places, which are left out of `tags`
    int unrefined = 0;  // tags that were read but could not be laid over the picture: left out
};

// Pixels from (x0, y0) up to but without (x1, y1).
struct PictureRegion {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

class TagDetector {
  public:
    // Error: the library is not installed.
    static Result<TagDetector> create();
    TagDetector(TagDetector&&) noexcept;
    TagDetector& operator=(TagDetector&&) noexcept;
    ~TagDetector();

    // The whole picture with every tag refined. Cost: about 25 ms for 1280 x 720, and 0.2 ms per
    // tag.
    TagFindings find(const GreyPicture& picture);
    // Adds the tags of a part of the picture to `tags`, with corners to a pixel or so. step:
    // squares are looked for on every so many pixels, after a blur of that standard deviation, in
    // steps. Cost: 25 ms at a step of 2 for 1280 x 720, 11 ms at 3, 15 ms at 2 with a blur of 0.8;
    // less for parts in proportion.
    void read(const GreyPicture& picture,
              const PictureRegion& region,
              int step,
              std::vector<SeenTag>& tags,
              double blur = 0);
    // The number of tags that are seen once the picture is mirrored: a camera that shows its user
    // as a mirror does.
    int count_mirrored(const GreyPicture& picture);

  private:
    struct State;
    explicit TagDetector(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

// Bodies and board through a stream of pictures. What was seen in the last picture is looked for
// where it should be now; what was not, where it was last, and where the picture changed since it
// was last searched, so that it is found in the picture in which it comes back. Where more than a
// third of the picture changed, a third is searched after the other, so that it is found within
// three. What shows no change is searched in twentieths, in turn; after a pause, as at the
// beginning, all is. While everything is in view, changes and twentieths are searched in every
// fourth picture, for a second sheet or a wrong one.
class PictureFollower {
  public:
    PictureFollower(TagDetector detector, MarkerFollower follower);
    // time_s: of the middle of the exposure, rising. Cost: 5 to 10 ms for 1280 x 720 (benchmark
    // Camera), and up to 30 for the first one and after a pause.
    FollowerPicture follow(const GreyPicture& picture, double time_s);
    // Whether any tag at all was read in the last picture.
    bool any_tags() const { return any_tags_; }
    TagDetector& detector() { return detector_; }
    const MarkerFollower& follower() const { return follower_; }

  private:
    struct Place {
        Pixel middle;
        std::int64_t picture = -1000;
    };
    void look_at_board(const GreyPicture& picture);
    void look_at_tool(const GreyPicture& picture, MarkerRole role, const Rigid& camera_from_body);
    void look_at(const GreyPicture& picture, const PictureRegion& region);
    std::optional<PictureRegion> around_tags(MarkerRole role, const GreyPicture& picture) const;
    bool seen(MarkerRole role, int tags) const;
    static int sample_step(const GreyPicture& picture);
    void remember(const GreyPicture& picture, const PictureRegion& region);
    std::vector<PictureRegion> changed(const GreyPicture& picture) const;
    void search(const GreyPicture& picture);
    void read_all(const GreyPicture& picture, const PictureRegion& region, double blur);
    void note_twice();

    TagDetector detector_;
    MarkerFollower follower_;
    std::vector<int> board_order_;  // its tags, each as far as possible from those before it
    std::vector<SeenTag> raw_, fitted_;
    std::vector<int> twice_;
    std::array<Place, kMarkerTagIds> places_;
    std::array<std::int64_t, kMarkerTagIds> twice_until_;
    static constexpr int kParts = 3, kCellsAcross = 5, kCellsDown = 4;
    std::int64_t picture_ = 0;
    double last_s_ = -1e9;
    int width_px_ = 0, height_px_ = 0;
    int part_ = 0, cell_ = 0;             // that is searched next
    std::vector<std::uint8_t> searched_;  // what it looked like there when it was, every so many px
    std::array<std::optional<PictureRegion>, 2> unposed_;  // tools whose tags gave no pose
    std::vector<Pixel> foreign_;  // where tags lie that are on none of our sheets
    bool any_tags_ = false;
};

}  // namespace sonocase
