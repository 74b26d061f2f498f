// SPDX-License-Identifier: Apache-2.0

// What the page calls: plain functions over the one PagePlayer that a page has. Texts and bytes
// come back through text() and bytes(), numbers that the page shows through values(). Functions
// that can fail return 0 and leave the reason in text(). page/core.js is the other side.

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/digest.h"
#include "formats/exercise/course.h"
#include "runtime/engine/auto_gain.h"
#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/web/page_json.h"
#include "runtime/web/page_player.h"
#include "runtime/web/page_scene.h"
#include "runtime/web/warm_up.h"

#define SONOCASE_EXPORT(name) extern "C" __attribute__((export_name(#name)))

using namespace sonocase;
using namespace sonocase::runtime;

namespace {

// Order of values(); page/core.js names them in the same order.
enum Value {
    kWidth,
    kHeight,
    kMmPerPx,
    kOriginX,
    kOriginY,
    kDepthMm,
    kFocusMm,
    kModelPaper,
    kHasNeedle,
    kNeedleDepthMm,
    kInContact,
    kPressMm,
    kKept,
    kAttempt,
    kSeconds,
    kInsertions,
    kTargetsHit,
    kTipToTargetMm,
    kTipInView,
    kInNoGo,
    kDamaged,
    kFrameNumber,
    kMissing,  // blocks
    kSegmentsLeft,
    kHasFlow,    // 0: says nothing of the flow of blood, or no Doppler mode was on
    kMachineHz,  // pictures per second of a machine with this colour box
    kSoundHz,
    kBeats,  // of the spectrum, that were measured; the next four are of them
    kPsv,
    kEdv,
    kResistiveIndex,
    kFlow,
    kValueCount
};

struct Page {
    RawVector<std::uint8_t> incoming;
    std::optional<Arrivals> arrivals;  // of incoming; the player's own once it is open
    std::vector<std::uint64_t> segment_hashes;
    std::vector<SegmentRun> runs;
    std::unique_ptr<PagePlayer> player, warming;
    ImageSettings settings;
    std::string text;
    std::vector<std::uint8_t> bytes;
    std::vector<std::uint32_t> screen;
    std::array<double, kValueCount> values{};
    std::array<double, 32> poses{};
    std::vector<double> numbers;  // of what was asked for last: targets, marks
    std::array<double, 16> doppler{};
    std::string result;                // result_json() of the attempt that ended last
    std::optional<GuidedStart> guide;  // runs
    Course course;
};
Page page;

// Returns 1, or 0 with the reason in text().
int answer(const Status& status) {
    page.text = status ? std::string() : status.error().message();
    return status ? 1 : 0;
}

Rigid rigid_at(const double* rows) {
    Rigid out;
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) out.rotation(r, c) = rows[4 * r + c];
    out.translation = {rows[3], rows[7], rows[11]};
    return out;
}

void fill_values() {
    PagePlayer& p = *page.player;
    const ScanEngine& engine = p.engine();
    const Renderer::Layout layout = engine.renderer().layout();
    auto& v = page.values;
    v = {};
    v[kWidth] = p.image().width_px;
    v[kHeight] = p.image().height_px;
    v[kMmPerPx] = layout.mm_per_px;
    v[kOriginX] = layout.origin_x_px;
    v[kOriginY] = layout.origin_y_px;
    v[kDepthMm] = p.image().depth_mm;
    v[kFocusMm] = p.image().focus_mm;
    v[kModelPaper] = p.image().model == ImageModel::paper;
    v[kHasNeedle] = engine.last().tools.has_needle;
    v[kNeedleDepthMm] = p.hands().needle_depth_mm();
    v[kInContact] = p.hands().in_contact();
    v[kPressMm] = p.hands().press_mm();
    v[kKept] = p.kept();
    v[kDamaged] = p.bundle().blocks() && p.bundle().blocks()->damaged();
    v[kFrameNumber] = engine.last().input.frame;
    v[kMissing] = p.missing_blocks();
    if (p.bundle().arrivals())
        v[kSegmentsLeft] = static_cast<double>(p.bundle().arrivals()->left());
    const doppler::SpectralMeasures measures = p.doppler().measures();
    v[kHasFlow] = p.doppler().has_flow();
    v[kMachineHz] = p.doppler().machine_hz();
    v[kSoundHz] = p.doppler().sound_hz();
    v[kBeats] = measures.beats;
    v[kPsv] = measures.psv_cm_s;
    v[kEdv] = measures.edv_cm_s;
    v[kResistiveIndex] = measures.resistive_index;
    v[kFlow] = measures.flow_ml_min;
    if (const PageSession* attempt = p.attempt()) {
        const SessionMonitor& monitor = attempt->monitor();
        v[kAttempt] = 1;
        v[kSeconds] = attempt->seconds();
        v[kInsertions] = monitor.insertions();
        v[kTargetsHit] = monitor.targets_hit();
        v[kTipToTargetMm] = monitor.tip_to_target_mm();
        v[kTipInView] = monitor.tip_in_view();
        v[kInNoGo] = monitor.in_no_go();
    }
}

}  // namespace

SONOCASE_EXPORT(text) const char* text() {
    return page.text.data();
}
SONOCASE_EXPORT(text_bytes) std::size_t text_bytes() {
    return page.text.size();
}
SONOCASE_EXPORT(bytes) const std::uint8_t* bytes() {
    return page.bytes.data();
}
SONOCASE_EXPORT(bytes_count) std::size_t bytes_count() {
    return page.bytes.size();
}
SONOCASE_EXPORT(values) const double* values() {
    if (page.player) fill_values();
    return page.values.data();
}
SONOCASE_EXPORT(value_count) int value_count() {
    return kValueCount;
}

// Room for the next case's bytes; the page writes them there and calls open_case().
SONOCASE_EXPORT(reserve) std::uint8_t* reserve(std::size_t count) {
    page.arrivals.reset();
    page.incoming = {};
    page.incoming.resize(count);
    return page.incoming.data();
}
// Room for a text that the page hands over; its address is that of reserve_text().
SONOCASE_EXPORT(reserve_text) char* reserve_text(std::size_t count) {
    page.text.assign(count, ' ');
    return page.text.data();
}
// XXH3-128 of the bytes at `from`, as 32 hex digits in text().
SONOCASE_EXPORT(digest) void digest(const std::uint8_t* from, std::size_t count) {
    page.text = digest_of(std::span<const std::uint8_t>(from, count));
}

// text(): name of the case, for errors; on success its description (page_json.h).
SONOCASE_EXPORT(open_case) int open_case() {
    const std::string name = page.text;
    auto opened = page.arrivals ? PagePlayer::open_in_parts(std::move(page.incoming),
                                                            std::move(*page.arrivals), name)
                                : PagePlayer::open(std::move(page.incoming), name);
    page.incoming = {};
    page.arrivals.reset();
    if (!opened) return answer(opened.error());
    page.player = std::move(*opened);
    page.text = case_json(*page.player);
    return 1;
}

// A case that arrives in segments: after reserve(), room for XXH3-64 of each segment. Bytes go
// where reserve() said, before and after open_case().
SONOCASE_EXPORT(begin_segments) std::uint64_t* begin_segments(std::size_t segment_bytes) {
    page.arrivals.emplace(page.incoming.size(), segment_bytes);
    page.segment_hashes.assign(page.arrivals->segments(), 0);
    return page.segment_hashes.data();
}
// The segment's bytes have been written. 0: they are not those of the case.
SONOCASE_EXPORT(arrive) int arrive(std::size_t segment) {
    const Arrivals& arrivals = page.arrivals ? *page.arrivals : *page.player->bundle().arrivals();
    const std::span<const std::uint8_t> bytes =
        page.arrivals ? std::span<const std::uint8_t>(page.incoming) : page.player->bytes();
    const ByteRange range = arrivals.range(segment);
    if (hash_of(bytes.subspan(range.at, range.count)) != page.segment_hashes[segment]) return 0;
    if (page.arrivals) {
        page.arrivals->add(segment);
    } else {
        page.player->arrived(segment);
    }
    return 1;
}
SONOCASE_EXPORT(look_again) int look_again() {
    return answer(page.player->look_again());
}
// Returns how many runs there are: pairs of first segment and count, at runs().
SONOCASE_EXPORT(next_runs) std::size_t next_runs(std::size_t max_segments) {
    page.runs = page.player->next_runs(max_segments);
    return page.runs.size();
}
SONOCASE_EXPORT(runs) const SegmentRun* runs() {
    return page.runs.data();
}
SONOCASE_EXPORT(ask_again) void ask_again(std::uint32_t first, std::uint32_t count) {
    page.player->ask_again({first, count});
}
// 0: the author's signature is not checked yet, call again; 1: text() says whose it is and whether
// it fits (page_json.h).
SONOCASE_EXPORT(check_signature) int check_signature() {
    const CaseSignature* found = page.player->check_signature();
    if (!found) return 0;
    page.text = signature_json(*found);
    return 1;
}
// Work that every case needs, to be done while one is on its way.
SONOCASE_EXPORT(prepare) void prepare() {
    PagePlayer::prepare();
}
// Opens the case as far as it is here, and drops it: the browser has compiled most of what opening
// runs when the rest comes.
SONOCASE_EXPORT(rehearse) void rehearse() {
    if (page.arrivals) rehearse_opening(page.incoming, *page.arrivals);
}
// A picture of the program's own small case; frame 0 makes it, a negative one ends it.
SONOCASE_EXPORT(warm_up) void warm_up(int frame) {
    if (frame < 0) page.warming.reset();
    if (frame == 0) page.warming = warm_up_player(512);
    if (frame < 0 || !page.warming) return;
    // What a scene is made with has to run more than once, too.
    if (frame % 4 == 3 && !page.warming->choose_exercise(0, 512, 512)) return;
    page.warming->hands().slide(0, frame % 2 ? 2 : -2);
    page.warming->frame(0.03 * frame, {});
}
SONOCASE_EXPORT(close_case) void close_case() {
    page.player.reset();
}
// text(): the attempt that ended last, for the page after it (page_json.h).
SONOCASE_EXPORT(result) void result() {
    page.text = page.result;
}
// The guided start: begun (1) or ended (0).
SONOCASE_EXPORT(run_guide) void run_guide(int runs) {
    page.guide = runs ? std::optional<GuidedStart>(std::in_place) : std::nullopt;
}
SONOCASE_EXPORT(skip_guide) void skip_guide() {
    if (page.guide) page.guide->skip();
}
// Once per picture: takes note of what the hands did. 0: no guide runs; else text() is where it
// stands (page_json.h).
SONOCASE_EXPORT(guide) int guide(int frozen) {
    if (!page.guide) return 0;
    const ToolPoses& tools = page.player->engine().last().tools;
    page.guide->observe({.has_probe = tools.has_probe,
                         .mannequin_from_probe = tools.mannequin_from_probe,
                         .frozen = frozen != 0,
                         .has_needle = tools.has_needle,
                         .needle_depth_mm = page.player->hands().needle_depth_mm()});
    page.text = guide_json(*page.guide);
    return 1;
}

SONOCASE_EXPORT(metric_words) void metric_words() {
    page.text = metric_words_json();
}

SONOCASE_EXPORT(choose_exercise) int choose_exercise(int index, int width_px, int height_px) {
    return answer(page.player->choose_exercise(index, width_px, height_px));
}
SONOCASE_EXPORT(set_image)
int set_image(int paper, int width_px, int height_px, double depth_mm, double focus_mm) {
    PageImage image;
    image.model = paper ? ImageModel::paper : ImageModel::physical;
    image.width_px = width_px;
    image.height_px = height_px;
    image.depth_mm = depth_mm;
    image.focus_mm = focus_mm;
    return answer(page.player->set_image(image));
}
SONOCASE_EXPORT(set_console) void set_console(double gain_db, double range_db, int flip) {
    page.settings.gain_db = gain_db;
    page.settings.dynamic_range_db = range_db;
    page.settings.flip_left_right = flip != 0;
}
SONOCASE_EXPORT(set_tgc) void set_tgc(int slider, double db) {
    page.settings.tgc_db[static_cast<std::size_t>(slider) % page.settings.tgc_db.size()] = db;
}

// Gain and depth gain from the last picture (runtime/engine/auto_gain.h): gain, then the sliders.
SONOCASE_EXPORT(adjust_gain) const double* adjust_gain() {
    const PagePlayer& p = *page.player;
    const runtime::Renderer& renderer = p.engine().renderer();
    runtime::adjust_gain(p.pixels(), p.image().width_px, renderer.layout(), p.image().depth_mm,
                         renderer.gain_law(), page.settings);
    page.numbers.assign(page.settings.tgc_db.begin(), page.settings.tgc_db.end());
    page.numbers.insert(page.numbers.begin(), page.settings.gain_db);
    return page.numbers.data();
}

SONOCASE_EXPORT(frame) int frame(double now_s) {
    return static_cast<int>(page.player->frame(now_s, page.settings));
}
SONOCASE_EXPORT(frame_unseen) void frame_unseen(double now_s) {
    page.player->frame_unseen(now_s, page.settings);
}
SONOCASE_EXPORT(frame_again) int frame_again(int back) {
    return static_cast<int>(page.player->frame_again(back, page.settings));
}
SONOCASE_EXPORT(look_at_attempt) int look_at_attempt(double time_s) {
    return page.player->look_at_attempt(time_s);
}
SONOCASE_EXPORT(kept_age_s) double kept_age_s(int back) {
    return page.player->kept_age_s(back);
}
SONOCASE_EXPORT(pixels) const std::uint8_t* pixels() {
    return page.player->pixels().data();
}

// The picture's pixels as words of a screen: red, green and blue from the lowest byte up, 255.
SONOCASE_EXPORT(screen) const std::uint32_t* screen() {
    const std::span<const std::uint8_t> pixels = page.player->pixels();
    page.screen.resize(pixels.size());
    for (std::size_t n = 0; n < pixels.size(); ++n)
        page.screen[n] = 0xff000000u | pixels[n] * 0x10101u;
    return page.screen.data();
}

SONOCASE_EXPORT(slide) void slide(double x_mm, double y_mm) {
    page.player->hands().slide(x_mm, y_mm);
}
SONOCASE_EXPORT(tilt) void tilt(double rock_rad, double fan_rad) {
    if (rock_rad != 0) page.player->hands().rock(rock_rad);
    if (fan_rad != 0) page.player->hands().fan(fan_rad);
}
SONOCASE_EXPORT(turn) void turn(double angle_rad) {
    page.player->hands().rotate(angle_rad);
}
SONOCASE_EXPORT(press) void press(double mm) {
    page.player->hands().press(mm);
}
SONOCASE_EXPORT(probe_home) void probe_home() {
    page.player->hands().reset();
}
// mannequin_from_probe of the hands, 16 numbers row by row.
SONOCASE_EXPORT(hands_pose) const double* hands_pose() {
    const std::array<double, 16> rows =
        matrix_from_rigid(page.player->hands().mannequin_from_probe());
    std::copy(rows.begin(), rows.end(), page.poses.begin());
    return page.poses.data();
}
SONOCASE_EXPORT(take_needle) int take_needle(int in_plane) {
    return page.player->hands().take_needle(page.player->exercise().probe, in_plane != 0);
}
// A needle in the plane, aimed at a place of the scan plane (probe frame); one that is out already
// is aimed anew.
SONOCASE_EXPORT(needle_to) int needle_to(double x_mm, double z_mm) {
    MouseTracker& hands = page.player->hands();
    if (!hands.has_needle() && !hands.take_needle(page.player->exercise().probe, true)) return 0;
    (void)hands.aim_needle_at(hands.mannequin_from_probe() * Point3{x_mm, 0, z_mm});
    return 1;
}
SONOCASE_EXPORT(withdraw_needle) void withdraw_needle() {
    page.player->hands().withdraw_needle();
}
SONOCASE_EXPORT(aim_needle) void aim_needle(double in_rad, double out_rad) {
    page.player->hands().aim_needle(in_rad, out_rad);
}
SONOCASE_EXPORT(advance_needle) void advance_needle(double mm) {
    page.player->hands().advance_needle(mm);
}
SONOCASE_EXPORT(slide_needle) void slide_needle(double x_mm, double y_mm) {
    page.player->hands().slide_needle(x_mm, y_mm);
}
// Two 4 x 4 matrices row by row, mannequin_from_probe and mannequin_from_needle, for put_tools().
SONOCASE_EXPORT(poses) double* poses() {
    return page.poses.data();
}
// States: SensorState, in the order of kToolStates of page/core.js. tracker: of kTrackers there.
SONOCASE_EXPORT(put_tools)
void put_tools(double now_s, int probe_state, int needle_state, int tracker) {
    constexpr const char* kTrackers[] = {"", "poses", "camera", "usb"};
    TrackerReading reading;
    reading.time_s = now_s;
    reading.in_mannequin = true;
    reading.sensor_count = 2;
    const int states[] = {probe_state, needle_state};
    for (const int tool : {kProbeSensor, kNeedleSensor})
        if (states[tool] != 0)
            reading.sensors[tool] = {static_cast<SensorState>(states[tool]),
                                     rigid_at(page.poses.data() + 16 * tool), 1.0f, 0};
    page.player->put_tools(now_s, reading, kTrackers[tracker]);
}

// text(): trainee, a line break, start as ISO 8601. seed: that targets and start are drawn with.
SONOCASE_EXPORT(start_attempt) int start_attempt(double now_s, double seed) {
    const std::size_t end = page.text.find('\n');
    const std::string trainee = page.text.substr(0, end), started = page.text.substr(end + 1);
    return answer(
        page.player->start_attempt(trainee, started, now_s, static_cast<std::uint64_t>(seed)));
}
// Four numbers for each target at numbers(): its middle in the `probe` frame and its radius.
SONOCASE_EXPORT(target_count) int target_count() {
    const std::vector<Target>& targets = page.player->exercise().targets;
    page.numbers.clear();
    for (std::size_t i = 0; i < targets.size(); ++i) {
        const Point3 at = page.player->target_in_probe(i);
        page.numbers.insert(page.numbers.end(), {at.x, at.y, at.z, targets[i].radius_mm});
    }
    return static_cast<int>(targets.size());
}
SONOCASE_EXPORT(numbers) const double* numbers() {
    return page.numbers.data();
}
// text(): the label that a pixel of the last picture shows.
SONOCASE_EXPORT(name_at) void name_at(int column, int row) {
    page.text = page.player->name_at(column, row);
}
SONOCASE_EXPORT(drop_attempt) void drop_attempt() {
    page.player->drop_attempt();
}
// text(): the last events in words (page_json.h).
SONOCASE_EXPORT(attempt_words) void attempt_words() {
    page.text = events_json(*page.player);
}
// text(): where the procedure of the attempt stands (page_json.h).
SONOCASE_EXPORT(procedure) void procedure() {
    page.text = procedure_json(*page.player);
}
// An act of the procedure, by the number of its kind (formats/recording/acts.h). 0: too many wait.
SONOCASE_EXPORT(act) int act(int kind, int index, double amount) {
    if (kind < 0 || kind >= kActKinds) return 0;
    return page.player->act({static_cast<ActKind>(kind), index, amount}) ? 1 : 0;
}
// bytes(): the recording; text(): its scores (score_json).
SONOCASE_EXPORT(finish_attempt) int finish_attempt() {
    Result<FinishedSession> finished = page.player->finish_attempt();
    if (!finished) return answer(finished.error());
    page.bytes = std::move(finished->recording);
    page.text = std::move(finished->score_json);
    page.result = result_json(finished->score);
    return 1;
}

// text(): a sweep of the exercise, which plays from now on (page_player.h).
SONOCASE_EXPORT(watch) int watch(double now_s) {
    return answer(page.player->watch(page.text, now_s));
}
SONOCASE_EXPORT(watching) int watching() {
    return page.player && page.player->watching();
}
SONOCASE_EXPORT(end_watching) void end_watching() {
    page.player->end_watching();
}

// A course. text(): language, a line break, the course as TOML; on success the course in that
// language (page_json.h).
SONOCASE_EXPORT(open_course) int open_course() {
    const std::size_t end = std::min(page.text.find('\n'), page.text.size());
    auto course = parse_course(std::string_view(page.text).substr(end), "course.toml");
    if (!course) return answer(course.error());
    page.course = std::move(*course);
    page.text = course_json(course_in(page.course, page.text.substr(0, end)));
    return 1;
}
// text(): what is kept of a trainee; on success how the trainee stands in that course
// (page_json.h).
SONOCASE_EXPORT(stand_in_course) int stand_in_course() {
    auto standing = course_standing_json(page.course, page.text);
    if (!standing) return answer(standing.error());
    page.text = std::move(*standing);
    return 1;
}
// text(): attempts that are kept, and the exercises that are asked about; on success how the
// trainee stands with each (page_json.h).
SONOCASE_EXPORT(stand_with) int stand_with() {
    auto standings = standings_json(page.text);
    if (!standings) return answer(standings.error());
    page.text = std::move(*standings);
    return 1;
}

// The Doppler modes.

namespace {

// Order of doppler(); page/core.js names them in the same order.
void fill_doppler(const DopplerSettings& d) {
    page.doppler = {double(d.mode),  d.box_left,       d.box_right,   d.box_top_mm,
                    d.box_bottom_mm, d.steer_deg,      d.scale_cm_s,  d.spectral_scale_cm_s,
                    d.baseline,      double(d.invert), d.wall_filter, d.gain_db,
                    d.gate_line,     d.gate_depth_mm,  d.gate_mm,     d.angle_deg};
}

DopplerSettings settings_of(const std::array<double, 16>& from) {
    DopplerSettings d;
    d.mode = static_cast<DopplerMode>(std::clamp(static_cast<int>(from[0]), 0, 4));
    d.box_left = from[1];
    d.box_right = from[2];
    d.box_top_mm = from[3];
    d.box_bottom_mm = from[4];
    d.steer_deg = from[5];
    d.scale_cm_s = from[6];
    d.spectral_scale_cm_s = from[7];
    d.baseline = from[8];
    d.invert = from[9] != 0;
    d.wall_filter = from[10];
    d.gain_db = from[11];
    d.gate_line = from[12];
    d.gate_depth_mm = from[13];
    d.gate_mm = from[14];
    d.angle_deg = from[15];
    return d;
}

int put_points(std::span<const PlanePoint> points) {
    page.numbers.clear();
    for (const PlanePoint p : points) page.numbers.insert(page.numbers.end(), {p.x, p.z});
    return static_cast<int>(points.size());
}

}  // namespace

// The settings: read here, and written here before set_doppler().
SONOCASE_EXPORT(doppler) double* doppler_settings() {
    fill_doppler(page.settings.doppler);
    return page.doppler.data();
}
SONOCASE_EXPORT(set_doppler) int set_doppler() {
    const DopplerSettings wanted = settings_of(page.doppler);
    if (wanted.mode != DopplerMode::off)
        if (const Status begun = page.player->begin_doppler(); !begun) return answer(begun);
    page.settings.doppler = wanted;
    return 1;
}
// Box and gate to the widest vessel of the plane. 0: it cuts none.
SONOCASE_EXPORT(aim_doppler) int aim_doppler() {
    DopplerSettings& settings = page.settings.doppler;
    const DopplerSettings aimed = page.player->doppler().aimed(page.player->engine(), settings);
    const bool moved = !(aimed == settings);
    settings = aimed;
    return moved;
}
// A linear probe's lines can be steered.
SONOCASE_EXPORT(steers) int steers() {
    return !doppler_geometry(page.player->engine()).fan;
}
// What a pointer takes hold of at a place of the scan plane, as doppler::Held.
SONOCASE_EXPORT(hold_doppler) int hold_doppler(double x_mm, double z_mm, double reach_mm) {
    return static_cast<int>(doppler::hold_at(doppler_geometry(page.player->engine()),
                                             page.settings.doppler, {x_mm, z_mm}, reach_mm));
}
SONOCASE_EXPORT(drag_doppler)
void drag_doppler(int held, double from_x, double from_z, double to_x, double to_z) {
    doppler::drag_held(doppler_geometry(page.player->engine()), static_cast<doppler::Held>(held),
                       {from_x, from_z}, {to_x, to_z}, page.settings.doppler);
}
// Two numbers for each point at numbers(): the box's outline, or face, end, upper, lower and middle
// of the gate.
SONOCASE_EXPORT(doppler_marks) int doppler_marks() {
    const ScanGeometry geometry = doppler_geometry(page.player->engine());
    const DopplerSettings& settings = page.settings.doppler;
    if (settings.mode == DopplerMode::colour || settings.mode == DopplerMode::power)
        return put_points(doppler::box_outline(geometry, settings));
    const doppler::GateMarks gate = doppler::gate_marks(geometry, settings);
    return put_points(std::array{gate.face, gate.end, gate.upper, gate.lower, gate.middle});
}

// Null: the last picture is grey.
SONOCASE_EXPORT(overlay) const std::uint8_t* overlay() {
    return page.player->doppler().overlay().data();
}
// 256 times red, green, blue.
SONOCASE_EXPORT(palette) const std::uint8_t* palette(int power) {
    return doppler::palette(power ? DopplerMode::power : DopplerMode::colour)[0].data();
}
// Null: the mode has none.
SONOCASE_EXPORT(strip) const std::uint8_t* strip(int width, int height) {
    return page.player->doppler().strip(width, height).data();
}
// Pairs of samples at sound().
SONOCASE_EXPORT(sound_count) std::size_t sound_count() {
    return page.player->doppler().sound().size() / 2;
}
SONOCASE_EXPORT(sound) const float* sound() {
    return page.player->doppler().sound().data();
}

// The 3-D view.

namespace {

struct Scene {
    const PagePlayer* of = nullptr;  // whose case it shows
    PageScene scene;
    Model model;
} shown;

PageScene& scene() {
    if (shown.of != page.player.get() || !shown.scene.begun()) {
        shown.scene.begin(*page.player->bundle());
        shown.of = page.player.get();
    }
    return shown.scene;
}

PlanePicture picture_of(const PagePlayer& player) {
    const PageImage& image = player.image();
    return {player.engine().renderer().layout(), image.depth_mm,
            player.engine().last().input.settings.flip_left_right, image.width_px, image.height_px};
}

}  // namespace

// Number of parts without organs; makes the skin of a case when it is first asked.
SONOCASE_EXPORT(scene_parts) int scene_parts() {
    return scene().parts();
}
// The same with organs, which are made now.
SONOCASE_EXPORT(scene_organs) int scene_organs() {
    scene().add_organs(*page.player->bundle());
    return scene().parts();
}
// Memory of the meshes is given back.
SONOCASE_EXPORT(scene_end) void scene_end() {
    shown = {};
}
// Number of vertices, of eight floats each, at scene_vertices(); indices at scene_indices().
SONOCASE_EXPORT(scene_part) std::size_t scene_part(int part) {
    shown.model = scene().part(part, page.player->engine(), picture_of(*page.player));
    return shown.model.vertices.size();
}
SONOCASE_EXPORT(scene_vertices) const float* scene_vertices() {
    return reinterpret_cast<const float*>(shown.model.vertices.data());
}
SONOCASE_EXPORT(scene_indices) const std::uint32_t* scene_indices() {
    return shown.model.indices.data();
}
SONOCASE_EXPORT(scene_index_count) std::size_t scene_index_count() {
    return shown.model.indices.size();
}
SONOCASE_EXPORT(scene_rgb) unsigned scene_rgb(int part) {
    return scene().rgb(part);
}
// At numbers(): yaw, pitch, distance of the first view.
SONOCASE_EXPORT(scene_first) void scene_first() {
    const Orbit orbit = scene().first(page.player->engine());
    page.numbers = {orbit.yaw_rad, orbit.pitch_rad, orbit.distance_mm};
}
// At numbers(): three matrices of 16, row by row: camera_from_mannequin, mannequin_from_probe,
// mannequin_from_needle as it is drawn. from: as ViewFrom.
SONOCASE_EXPORT(scene_places)
void scene_places(int from, double yaw_rad, double pitch_rad, double distance_mm) {
    const ScanEngine& engine = page.player->engine();
    const FrameRecord& record = engine.last();
    page.numbers.clear();
    for (const Rigid& place :
         {inverse(scene().camera(static_cast<ViewFrom>(from), {yaw_rad, pitch_rad, distance_mm},
                                 engine)),
          record.tools.mannequin_from_probe, record.needle.mannequin_from_drawn}) {
        const std::array<double, 16> rows = matrix_from_rigid(place);
        page.numbers.insert(page.numbers.end(), rows.begin(), rows.end());
    }
}
