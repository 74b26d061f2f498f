// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/place_pathology.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "formats/pathology/pathology_kinds.h"
#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/pathology/answer_key.h"
#include "pipeline/pathology/label_canvas.h"
#include "pipeline/pathology/lesion_parts.h"
#include "pipeline/pathology/lesion_place.h"
#include "pipeline/pathology/lesion_shape.h"

namespace sonocase::pipeline::inline pathology {

namespace {

constexpr double kSwellReachMm = 40;  // of a swelling, and of the depth of a vessel

double ball_radius_mm(double volume_ml) {
    return std::cbrt(3000 * volume_ml / (4 * kPi));
}

double ball_volume_ml(double radius_mm) {
    return 4 * kPi / 3000 * radius_mm * radius_mm * radius_mm;
}

// The same rank, tilted by 0.06 degrees so that no two voxels have the same one: volumes are then
// exact for shapes and levels that lie along the voxels.
VoxelField untied(VoxelField rank) {
    return [rank = std::move(rank)](Vector3 at) {
        return rank(at) + 0.00031 * at.x + 0.00047 * at.y + 0.00073 * at.z;
    };
}

// Places one lesion after the other: finds its place, makes its shape, paints it.
class Placer {
  public:
    Placer(const PathologyInput& input, PathologyResult& result)
        : input_(input), result_(result), canvas_(input.cooked, input.boundary) {
        for (std::size_t l = 0; l < input.palette.size(); ++l) {
            const Tissue* tissue = tissue_named(input.palette[l].tissue);
            const bool skin = input.palette[l].tissue == "skin";
            if (tissue == nullptr) continue;
            if (tissue->kind == TissueKind::outside || tissue->kind == TissueKind::bone || skin)
                fixed_.set(l);
            if (tissue->name == "blood" || tissue->name == "vein" || tissue->name == "artery")
                vessels_.set(l);
        }
        fixed_.set(0);
    }

    Status place(const PathologyRequest& request);
    void finish() {
        result_.boundary = canvas_.take_boundary();
        result_.volume = canvas_.take_volume();
    }

  private:
    struct Context {
        const PathologyRequest& request;
        const PathologyKind& kind;
        std::string where;
        LabelSet host;
        double voxel_mm = 1;
        double volume_ml = 0;
        std::size_t voxels = 0;  // of volume_ml
        double host_ml = 0;
        Vector3 down;
    };

    const Tissue* tissue_named(const std::string& name) const {
        for (const Tissue& tissue : input_.tissues)
            if (tissue.name == name) return &tissue;
        return nullptr;
    }
    Vector3 voxel_of(Point3 given, bool in_mannequin) const {
        if (!in_mannequin && input_.mannequin_from_ct) given = input_.mannequin_from_ct(given);
        return canvas_.grid().voxel_from_point(given) - Point3{};
    }
    std::uint8_t label_at(Vector3 v) const {
        const Int3 n{static_cast<int>(std::lround(v.x)), static_cast<int>(std::lround(v.y)),
                     static_cast<int>(std::lround(v.z))};
        return canvas_.grid().contains(n.x, n.y, n.z) ? canvas_.label(n) : std::uint8_t{0};
    }
    std::string name_at(Vector3 v) const { return canvas_.volume().labels[label_at(v)].name; }
    Vector3 gravity() const;
    double volume_of(const LabelSet& labels) const;
    Result<LabelSet> named(const std::vector<std::string>& names, const std::string& where) const;
    Result<Context> context(const PathologyRequest& request) const;
    const Clearances& clearances(const LabelSet& host, bool skin);

    Result<Lesion> rounded(const Context& c);
    Result<Vector3> centre_of(const Context& c, const RoughEllipsoid& shape, double radius_mm);
    Error no_room(const Context& c, const RoughEllipsoid& shape, const PlaceRules& rules);
    Result<Lesion> bulge(const Context& c, const RoughEllipsoid& shape, double radius_mm);
    Result<Lesion> pool(const Context& c);
    Result<Lesion> swelling(const Context& c);
    Result<Lesion> tube(const Context& c);
    Result<Lesion> filled(const Context& c,
                          const VoxelRange& range,
                          const VoxelField& rank,
                          const VoxelField& limit,
                          const LabelSet& into,
                          std::size_t voxels);
    PlaceRules rules_of(const Context& c) const;

    const PathologyInput& input_;
    PathologyResult& result_;
    LabelCanvas canvas_;
    LabelSet fixed_, vessels_;
    std::vector<PlacedLesion> earlier_;
    struct Known {
        LabelSet host;
        bool skin;
        std::unique_ptr<Clearances> clear;
    };
    std::vector<Known> known_;
};

}  // namespace

double part_size(const PathologyRequest& request, const LesionPart& part) {
    const auto given = request.parts.find(part.name);
    return given == request.parts.end() ? part.size : given->second;
}

std::vector<std::string> pathology_labels(const PathologyRequest& request) {
    std::vector<std::string> names{request.name};
    if (const PathologyKind* kind = find_pathology_kind(request.kind))
        for (const LesionPart& part : kind->parts)
            if (part_size(request, part) > 0) names.push_back(request.name + "_" + part.name);
    return names;
}

std::vector<Tissue> pathology_tissues(std::span<const PathologyRequest> requests) {
    std::vector<Tissue> needed;
    const auto add = [&](const Tissue& tissue) {
        const bool known = std::any_of(needed.begin(), needed.end(),
                                       [&](const Tissue& t) { return t.name == tissue.name; });
        if (!known) needed.push_back(tissue);
    };
    for (const PathologyRequest& request : requests) {
        const PathologyKind* kind = find_pathology_kind(request.kind);
        if (kind == nullptr) continue;
        if (request.tissue.empty() && kind->tissue.name != "blood") add(kind->tissue);
        for (const LesionPart& part : kind->parts)
            if (part_size(request, part) > 0) add(part.tissue);
    }
    return needed;
}

// A widened vessel: along its axis, through its wall into all tissue that may be displaced.
Result<Lesion> Placer::bulge(const Context& c, const RoughEllipsoid& given, double radius_mm) {
    const PathologyRequest& r = c.request;
    const VoxelRange range = range_of(canvas_.volume(), c.host, 2);
    const VoxelField depth = distance_to_labels(canvas_.volume(), c.host, range, kSwellReachMm);
    std::optional<Vector3> wanted;
    if (r.centre) wanted = voxel_of(*r.centre, r.in_mannequin);
    if (r.near && !wanted) wanted = voxel_of(*r.near, r.in_mannequin);
    Vector3 centre;
    double best = 1e18;
    for (int k = range.low.z; k <= range.high.z; ++k)
        for (int j = range.low.y; j <= range.high.y; ++j)
            for (int i = range.low.x; i <= range.high.x; ++i) {
                if (!c.host[canvas_.label({i, j, k})]) continue;
                const Vector3 v{static_cast<double>(i), static_cast<double>(j),
                                static_cast<double>(k)};
                const double away = wanted ? 0.3 * norm(v - *wanted) : 0;
                const double score = depth(v) + away;
                if (score >= best) continue;
                best = score;
                centre = v;
            }
    RoughEllipsoid shape = given;
    shape.align(long_axis(canvas_, c.host, centre, 25 / c.voxel_mm));
    Lesion lesion;
    lesion.centre_vx = centre;
    lesion.radius_vx = radius_mm / c.voxel_mm;
    lesion.down = c.down;
    lesion.into = ~fixed_;
    lesion.range = canvas_.around(centre, 1.2 * shape.max_radius() * lesion.radius_vx + 2);
    const VoxelField rank = untied(shape.rank_about(centre));
    std::size_t found = 0;
    const double threshold = canvas_.threshold(lesion.range, rank, lesion.into, c.voxels, &found);
    lesion.distance = distance_to_level(rank, threshold, 1);
    return lesion;
}

Result<Lesion> Placer::filled(const Context& c,
                              const VoxelRange& range,
                              const VoxelField& tied,
                              const VoxelField& limit,
                              const LabelSet& into,
                              std::size_t voxels) {
    const VoxelField rank = untied(tied);
    const VoxelField limited = [&](Vector3 at) {
        return limit && limit(at) > 0 ? static_cast<double>(INFINITY) : rank(at);
    };
    std::size_t found = 0;
    const double threshold = canvas_.threshold(range, limited, into, voxels, &found);
    const double ml = static_cast<double>(found) * canvas_.grid().voxel_volume_mm3() / 1000;
    if (found < voxels)
        return Error{"there is room for " + number_text(ml, 3) + " ml and not for " +
                         number_text(c.volume_ml, 3),
                     c.where, found == 0 ? "no voxel of its host lies there" : "make it smaller"};
    Lesion lesion;
    lesion.range = range;
    lesion.distance = distance_to_level(rank, threshold, 1);
    if (limit) lesion.distance = intersection(lesion.distance, limit);
    lesion.radius_vx = ball_radius_mm(c.volume_ml) / c.voxel_mm;
    lesion.down = c.down;
    lesion.into = into;
    return lesion;
}

Result<Lesion> Placer::pool(const Context& c) {
    const PathologyRequest& r = c.request;
    const int reach = r.beside.empty() ? 1 : static_cast<int>((r.reach_mm + 6) / c.voxel_mm);
    const VoxelRange range = range_of(canvas_.volume(), c.host, reach);
    VoxelField limit;
    const auto also = [&](VoxelField field) {
        limit = limit ? intersection(limit, std::move(field)) : std::move(field);
    };
    if (!r.beside.empty()) {
        const double reach_vx = r.reach_mm / c.voxel_mm;
        for (const std::string& name : r.beside) {
            SONOCASE_TRY(const auto label, named({name}, c.where));
            const VoxelField near =
                distance_to_labels(canvas_.volume(), label, range, r.reach_mm + 5);
            also([near, reach_vx](Vector3 at) { return near(at) - reach_vx; });
        }
    }
    if (r.near) also(ball(voxel_of(*r.near, r.in_mannequin), r.near_mm / c.voxel_mm));
    return filled(c, range, height_rank(c.down), limit, c.host, c.voxels);
}

Result<Lesion> Placer::swelling(const Context& c) {
    SONOCASE_TRY(const auto into, named(c.request.into, c.where));
    const int grown = into.none() ? 1 : static_cast<int>(40 / c.voxel_mm);
    const VoxelRange range = range_of(canvas_.volume(), c.host, grown);
    return filled(c, range, distance_to_labels(canvas_.volume(), c.host, range, kSwellReachMm), {},
                  c.host | into, c.voxels);
}

Result<Lesion> Placer::tube(const Context& c) {
    const PathologyRequest& r = c.request;
    if (!r.path.empty()) {
        std::vector<Vector3> path;
        VoxelRange range{{1 << 29, 1 << 29, 1 << 29}, {-(1 << 29), -(1 << 29), -(1 << 29)}};
        const double radius_vx = 0.5 * r.diameter_mm / c.voxel_mm;
        for (const Point3 p : r.path) {
            path.push_back(voxel_of(p, r.in_mannequin));
            const VoxelRange one = canvas_.around(path.back(), radius_vx + 3);
            for (int axis = 0; axis < 3; ++axis) {
                range.low[axis] = std::min(range.low[axis], one.low[axis]);
                range.high[axis] = std::max(range.high[axis], one.high[axis]);
            }
        }
        Lesion lesion;
        lesion.range = range;
        const VoxelField rank = path_rank(path);
        lesion.distance = [rank, radius_vx](Vector3 at) { return rank(at) - radius_vx; };
        lesion.centre_vx = path[path.size() / 2];
        lesion.radius_vx = radius_vx;
        lesion.down = c.down;
        lesion.into = c.host;
        return lesion;
    }
    // In a vessel: a stretch of it, filled from below.
    const VoxelRange range = range_of(canvas_.volume(), c.host, 1);
    if (range.empty()) return Error{"its host has no voxel", c.where, "name another"};
    Vector3 middle;
    if (r.centre || r.near) {
        middle = voxel_of(r.centre ? *r.centre : *r.near, r.in_mannequin);
    } else {
        const Clearances& clear = clearances(c.host, false);
        const auto inside = clear.deeper_than(c.voxel_mm);
        if (inside.empty())
            return Error{"its host is thinner than a voxel", c.where, "name another"};
        const auto n = static_cast<std::size_t>(
            uniform_at(derive_seed(static_cast<std::uint64_t>(r.seed), 11), 0) *
            static_cast<double>(inside.size()));
        const VoxelBox& box = clear.box();
        const std::uint32_t at = inside[n], x = static_cast<std::uint32_t>(box.size.x),
                            y = static_cast<std::uint32_t>(box.size.y), j = at / x % y,
                            k = at / x / y;
        middle = {static_cast<double>(box.first.x) + at % x, static_cast<double>(box.first.y) + j,
                  static_cast<double>(box.first.z) + k};
    }
    const VoxelField limit = ball(middle, 0.5 * r.length_mm / c.voxel_mm);
    std::size_t lumen = 0;
    const VoxelField rank = height_rank(c.down);
    canvas_.threshold(
        range, [&](Vector3 at) { return limit(at) > 0 ? INFINITY : 0.0; }, c.host, 1, &lumen);
    const auto voxels =
        static_cast<std::size_t>(std::max(1.0, std::round(r.share * static_cast<double>(lumen))));
    if (lumen == 0)
        return Error{
            "no voxel of its host lies within " + number_text(0.5 * r.length_mm, 3) + " mm",
            c.where, "move its centre"};
    auto lesion = filled(c, range, rank, limit, c.host, voxels);
    if (lesion) lesion->centre_vx = middle;
    return lesion;
}

Vector3 Placer::gravity() const {
    const Point3 middle_ct = input_.ct_middle;
    if (!input_.mannequin_from_ct) return {0, -1, 0};
    // The map is smooth and nearly a rigid motion: one direction serves the whole body.
    const Vector3 down = input_.mannequin_from_ct({middle_ct.x, middle_ct.y - 50, middle_ct.z}) -
                         input_.mannequin_from_ct({middle_ct.x, middle_ct.y + 50, middle_ct.z});
    return normalized(down);
}

double Placer::volume_of(const LabelSet& labels) const {
    std::array<std::size_t, 256> count{};
    for (const std::uint8_t v : canvas_.volume().voxels) ++count[v];
    std::size_t sum = 0;
    for (std::size_t l = 0; l < 256; ++l)
        if (labels[l]) sum += count[l];
    return static_cast<double>(sum) * canvas_.grid().voxel_volume_mm3() / 1000;
}

Result<LabelSet> Placer::named(const std::vector<std::string>& names,
                               const std::string& where) const {
    LabelSet labels;
    std::vector<std::string> known;
    for (const Label& label : canvas_.volume().labels) known.push_back(label.name);
    for (const std::string& name : names) {
        const auto found = std::find(known.begin(), known.end(), name);
        if (found == known.end())
            return Error{"label '" + name + "' is not in this case", where,
                         suggest_name(name, known)};
        labels.set(static_cast<std::size_t>(found - known.begin()));
    }
    return labels;
}

Result<Placer::Context> Placer::context(const PathologyRequest& request) const {
    const std::string where =
        input_.where + ":" + std::to_string(request.line) + ": pathology '" + request.name + "'";
    const PathologyKind* kind = find_pathology_kind(request.kind);
    if (kind == nullptr)
        return Error{"unknown kind '" + request.kind + "'", where,
                     suggest_name(request.kind, pathology_kind_names())};
    for (const Label& label : canvas_.volume().labels)
        if (label.name == request.name)
            return Error{"a label of that name exists", where, "give it a name of its own"};
    SONOCASE_TRY(auto host, named(request.host, where));
    for (std::size_t l = 0; l < input_.palette.size(); ++l) {
        if (!host[l]) continue;
        const Tissue* tissue = tissue_named(input_.palette[l].tissue);
        const TissueKind of = tissue == nullptr ? TissueKind::soft : tissue->kind;
        const bool gas = of == TissueKind::gas && kind->shape == LesionShape::ellipsoid;
        if (l == 0 || of == TissueKind::outside || gas)
            return Error{"its host '" + input_.palette[l].name + "' is air", where,
                         "expected a label of tissue or fluid: nothing in air can be seen"};
    }
    Context c{.request = request,
              .kind = *kind,
              .where = where,
              .host = host,
              .voxel_mm = canvas_.grid().spacing_mm.x,
              .down = gravity()};
    c.volume_ml =
        request.volume_ml > 0 ? request.volume_ml : ball_volume_ml(0.5 * request.diameter_mm);
    c.voxels = static_cast<std::size_t>(
        std::max(1.0, std::round(1000 * c.volume_ml / canvas_.grid().voxel_volume_mm3())));
    c.host_ml = volume_of(host);
    return c;
}

const Clearances& Placer::clearances(const LabelSet& host, bool skin) {
    for (const Known& known : known_)
        if (known.host == host && (known.skin || !skin)) return *known.clear;
    // Distances are those of the labels as given; earlier lesions are checked separately.
    known_.push_back(
        {host, skin, std::make_unique<Clearances>(input_.cooked, host, vessels_ & ~host, skin)});
    return *known_.back().clear;
}

PlaceRules Placer::rules_of(const Context& c) const {
    const PathologyRequest& r = c.request;
    PlaceRules rules{.capsule_mm = r.capsule_mm,
                     .vessel_mm = r.vessel_mm,
                     .apart_mm = r.apart_mm,
                     .depth_low_mm = r.depth_low_mm,
                     .depth_high_mm = r.depth_high_mm,
                     .near_vx = std::nullopt,
                     .near_mm = r.near_mm,
                     .voxel_mm = c.voxel_mm,
                     .shell_mm = shell_mm(r, c.kind, c.voxel_mm)};
    if (r.near) rules.near_vx = voxel_of(*r.near, r.in_mannequin);
    return rules;
}

Error Placer::no_room(const Context& c, const RoughEllipsoid& shape, const PlaceRules& rules) {
    const Clearances& clear =
        clearances(c.host, rules.depth_low_mm > 0 || rules.depth_high_mm < 1e8);
    double fitting = 0;
    for (double ml = 0.85 * c.volume_ml; ml > 0.02 && fitting == 0; ml *= 0.85)
        if (find_place(shape, ball_radius_mm(ml), clear, rules, earlier_,
                       static_cast<std::uint64_t>(c.request.seed)))
            fitting = ml;
    return {"no place for " + number_text(c.volume_ml, 3) + " ml keeps its clearances in " +
                std::to_string(kPlacementTries) + " tries",
            c.where,
            fitting > 0 ? "the largest that fits has " + number_text(fitting, 3) +
                              " ml, a diameter of " + number_text(2 * ball_radius_mm(fitting), 3) +
                              " mm; or lower capsule_mm, vessel_mm or apart_mm"
                        : "lower capsule_mm, vessel_mm or apart_mm, or widen depth_mm or near_mm"};
}

Result<Vector3> Placer::centre_of(const Context& c, const RoughEllipsoid& shape, double radius_mm) {
    const PathologyRequest& r = c.request;
    const PlaceRules rules = rules_of(c);
    const Clearances& clear =
        clearances(c.host, rules.depth_low_mm > 0 || rules.depth_high_mm < 1e8);
    if (r.centre) {
        const Vector3 centre = voxel_of(*r.centre, r.in_mannequin);
        for (const PlacedLesion& other : earlier_)
            if (other.distance(centre) < radius_mm / c.voxel_mm)
                return Error{"it overlaps '" + other.name + "'", c.where,
                             "move its centre, or make one of them smaller"};
        if (!c.host[label_at(centre)])
            return Error{"its centre lies in '" + name_at(centre) + "'", c.where,
                         "expected a place in its host"};
        PlaceRules bare = rules;
        bare.near_vx.reset();
        if (!fits(shape, radius_mm, centre, clear, bare, earlier_))
            result_.report.warnings.push_back(
                r.name +
                " lies nearer to a border, a vessel or another lesion than its clearances "
                "allow; move its centre");
        return centre;
    }
    if (c.kind.settles) {
        if (const auto lowest = find_lowest(radius_mm, clear, c.down, c.voxel_mm, earlier_))
            return *lowest;
        return Error{"a stone of " + number_text(2 * radius_mm, 3) + " mm does not fit", c.where,
                     "the largest ball in its host has a diameter of " +
                         number_text(2 * clear.deepest_mm(), 3) + " mm"};
    }
    if (const auto place = find_place(shape, radius_mm, clear, rules, earlier_,
                                      static_cast<std::uint64_t>(r.seed)))
        return *place;
    return no_room(c, shape, rules);
}

Result<Lesion> Placer::rounded(const Context& c) {
    const PathologyRequest& r = c.request;
    const RoughEllipsoid shape(r.elongation < 0 ? c.kind.elongation : r.elongation,
                               r.roughness < 0 ? c.kind.roughness : r.roughness, c.kind.aspect,
                               derive_seed(static_cast<std::uint64_t>(r.seed), 7));
    const double radius_mm = ball_radius_mm(c.volume_ml);
    if (c.kind.name == "aneurysm") return bulge(c, shape, radius_mm);
    if (c.volume_ml >= c.host_ml)
        return Error{"it is larger than its host (" + number_text(c.volume_ml, 3) + " of " +
                         number_text(c.host_ml, 3) + " ml)",
                     c.where, "make it smaller"};
    SONOCASE_TRY(const auto centre, centre_of(c, shape, radius_mm));
    Lesion lesion;
    lesion.centre_vx = centre;
    lesion.radius_vx = radius_mm / c.voxel_mm;
    lesion.down = c.down;
    lesion.range = canvas_.around(centre, 1.25 * shape.max_radius() * lesion.radius_vx + 2);
    const VoxelField rank = untied(shape.rank_about(centre));
    lesion.into = r.mass_effect > 0 ? ~fixed_ : c.host;
    std::size_t found = 0;
    const double threshold = canvas_.threshold(lesion.range, rank, lesion.into, c.voxels, &found);
    if (found < c.voxels)
        return Error{
            "only " +
                number_text(static_cast<double>(found) * canvas_.grid().voxel_volume_mm3() / 1000,
                            3) +
                " of its " + number_text(c.volume_ml, 3) + " ml fit about its centre",
            c.where, "move its centre, or make it smaller"};
    if (r.mass_effect > 0) {
        const double min_det = push_aside(
            canvas_, {centre, rank, threshold, r.mass_effect, r.reach, fixed_ & ~c.host});
        result_.report.measures.push_back({r.name + "_least_det", min_det});
    }
    lesion.distance = distance_to_level(rank, threshold, 1);
    return lesion;
}

Status Placer::place(const PathologyRequest& request) {
    SONOCASE_TRY(auto c, context(request));
    SONOCASE_TRY(auto lesion, c.kind.shape == LesionShape::ellipsoid ? rounded(c)
                              : c.kind.shape == LesionShape::pool    ? pool(c)
                              : c.kind.shape == LesionShape::swell   ? swelling(c)
                                                                     : tube(c));
    SONOCASE_TRY(auto painted, paint_lesion(canvas_, lesion, request, c.kind));
    for (const std::string& part : painted.skipped)
        result_.report.notes.push_back(
            {request.name + "." + part, "thinner than a voxel: left to the echo of the interface"});
    PathologyEntry entry;
    entry.name = request.name;
    entry.kind = request.kind;
    for (const std::string& name : request.host)
        entry.host += (entry.host.empty() ? "" : ", ") + name;
    entry.seed = request.seed;
    measure_lesion(canvas_.volume(), lesion.range, painted.inside, vessels_ & ~c.host, entry);
    if (entry.volume_ml == 0) return Error{"nothing of it lies in its host", c.where, "move it"};
    result_.key.push_back(entry);
    if (c.kind.shape == LesionShape::ellipsoid) {
        const double shell_vx = shell_mm(request, c.kind, c.voxel_mm) / c.voxel_mm;
        PlacedLesion placed{lesion.centre_vx, {}, {}, request.name};
        const VoxelField inner = lesion.distance;
        placed.distance = [inner, shell_vx](Vector3 at) { return inner(at) - shell_vx; };
        for (const Vector3 u : sphere_directions(100))
            placed.surface.push_back(lesion.centre_vx + (lesion.radius_vx + shell_vx) * u);
        earlier_.push_back(std::move(placed));
    }
    return Done{};
}

Result<PathologyResult> place_pathology(const PathologyInput& input, const Progress& progress) {
    PathologyResult result;
    result.report.stage = stage_names::kPathology;
    result.report.version = kPathologyVersion;
    Placer placer(input, result);
    double done = 0;
    for (const PathologyRequest& request : input.requests) {
        report_progress(progress, done / static_cast<double>(input.requests.size()),
                        "placing " + request.name);
        SONOCASE_TRY_DONE(placer.place(request));
        done += 1;
    }
    placer.finish();
    result.report.measures.insert(result.report.measures.begin(),
                                  {"lesions", static_cast<double>(result.key.size())});
    add_key(result.key, result.report);
    report_progress(progress, 1, "lesions placed");
    return result;
}

}  // namespace sonocase::pipeline::inline pathology
