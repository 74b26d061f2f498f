// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/page_json.h"

#include <algorithm>
#include <climits>
#include <cmath>

#include "formats/base/clinical_names.h"
#include "formats/exercise/case_exercises.h"
#include "formats/exercise/metric_table.h"
#include "formats/scoring/attempt_result.h"
#include "formats/scoring/course_standing.h"
#include "formats/text/json_reader.h"
#include "runtime/engine/image_presets.h"

namespace sonocase::runtime::inline web {
namespace {

using detail::Json;

// The texts of an exercise in one of its other languages, whole.
Json json_of_texts(const ExerciseTexts& texts) {
    Json out = Json::object();
    out["title"] = texts.title;
    out["description"] = texts.description;
    out["hints"] = texts.hints;
    Json steps = Json::array(), items = Json::array();
    for (const ExerciseTexts::Step& step : texts.steps)
        steps.push_back(Json({{"title", step.title}, {"instruction", step.instruction}}));
    for (const ExerciseTexts::Item& item : texts.items)
        items.push_back(Json({{"name", item.name},
                              {"title", item.title},
                              {"question", item.question},
                              {"options", item.options}}));
    out["steps"] = std::move(steps);
    out["items"] = std::move(items);
    return out;
}

Json json_of_exercise(const CaseBundle& bundle, const Exercise& exercise) {
    Json out = Json::object();
    out["name"] = exercise.name;
    out["title"] = exercise.title;
    out["description"] = exercise.description;
    const std::vector<ExerciseTexts> texts = texts_of_exercise(bundle, exercise.name);
    out["texts"] = Json::object();
    for (const ExerciseTexts& one : texts)
        out["texts"][one.language] = json_of_texts(texts_in(exercise, texts, one.language));
    out["mastery"] = exercise.mastery;
    out["mark_mm"] = half_face_mm(exercise.probe);
    out["kind"] = exercise.kind;
    out["difficulty"] = exercise.difficulty;
    out["mode"] = exercise.mode == ExerciseMode::exam ? "exam" : "practice";
    out["hints"] = exercise.hints;
    // Whether an attempt draws targets or start anew, for which the whole case is needed.
    bool drawn = exercise.start_spread_mm > 0;
    for (const Target& lesion : shown_lesions(exercise)) drawn = drawn || lesion.spread_mm > 0;
    drawn = drawn || !exercise.findings.empty();
    out["drawn"] = drawn;
    Json targets = Json::array();
    for (const Target& target : exercise.targets) targets.push_back(target.name);
    out["targets"] = std::move(targets);
    Json marks = Json::array();
    for (const Exercise::PassMark& mark : exercise.pass_marks) {
        Json item = Json::object();
        item["metric"] = mark.metric;
        item["at_most"] = detail::json_number(mark.at_most);
        item["at_least"] = detail::json_number(mark.at_least);
        marks.push_back(std::move(item));
    }
    out["pass_marks"] = std::move(marks);
    return out;
}

}  // namespace

std::string signature_json(const CaseSignature& signature) {
    static constexpr const char* kFits[] = {"none", "fits", "differs", "unreadable"};
    Json out = Json::object();
    out["fit"] = kFits[static_cast<std::size_t>(signature.fit)];
    out["name"] = signature.name;
    out["fingerprint"] = fingerprint_of(signature.key);
    return detail::json_text(out, false);
}

std::string case_json(const PagePlayer& player) {
    Json out = Json::object();
    out["case_name"] = player.bundle()->manifest.case_name;
    out["title"] = case_title(player.bundle()->manifest);
    Json presets = Json::array();
    for (const ImagePreset& preset : kPresets)
        presets.push_back(Json({{"name", preset.name},
                                {"tip", preset.tip},
                                {"depth_mm", preset.depth_mm},
                                {"focus_mm", preset.focus_mm}}));
    out["presets"] = std::move(presets);
    Json complications = Json::object();
    for (std::size_t n = 0; n < complication_names().size(); ++n)
        complications[std::string(complication_names()[n])] = complication_titles()[n];
    out["complications"] = std::move(complications);
    Json exercises = Json::array();
    for (const Exercise& exercise : player.exercises())
        exercises.push_back(json_of_exercise(*player.bundle(), exercise));
    out["exercises"] = std::move(exercises);
    Json labels = Json::array();
    for (const Label& label : player.bundle()->labels) {
        const LabelParts parts = label_parts(label.name);
        labels.push_back(Json({{"name", label.name},
                               {"english", clinical_name(label.name)},
                               {"words", parts.words},
                               {"side", parts.side},
                               {"number", parts.number}}));
    }
    out["labels"] = std::move(labels);
    out["warnings"] = player.warnings();
    return detail::json_text(out, false);
}

std::string metric_words_json() {
    Json out = Json::array();
    for (const MetricInfo& info : metric_table()) {
        Json item = Json::object();
        item["name"] = info.name;
        item["title"] = info.title;
        item["unit"] = metric_unit(info.name);
        out.push_back(std::move(item));
    }
    return detail::json_text(out, false);
}

std::string result_json(const SessionScore& score) {
    const AttemptResult result = attempt_result(score);
    Json out = Json::object();
    out["has_marks"] = result.has_marks;
    out["passed"] = result.passed;
    out["marks"] = result.marks;
    out["marks_reached"] = result.marks_reached;
    out["advice"] = result.advice;
    Json rows = Json::array(), measures = Json::array();
    for (const ResultRow& row : result.rows)
        rows.push_back(Json({{"title", row.title},
                             {"value", metric_words(row.metric, row.value)},
                             {"measured", std::isfinite(row.value)},
                             {"has_limit", row.has_limit},
                             {"at_least", row.at_least},
                             {"none", !row.at_least && row.limit == 0},
                             {"limit", metric_words(row.metric, row.limit)},
                             {"reached", row.reached}}));
    out["trend"] = nullptr;
    if (!result.trend_metric.empty()) {
        const ResultRow& row = result.rows.front();
        out["trend"] = Json({{"metric", row.metric},
                             {"title", row.title},
                             {"limit", row.has_limit ? Json(row.limit) : Json(nullptr)}});
    }
    for (const Metric& metric : score.metrics) {
        const MetricInfo* info = find_metric(metric.name);
        if (!info || !std::isfinite(metric.value)) continue;
        measures.push_back(Json({{"title", info->title},
                                 {"value", metric_words(metric.name, metric.value)},
                                 {"evidence", info->evidence[0] != 0}}));
    }
    out["rows"] = std::move(rows);
    out["measures"] = std::move(measures);
    return detail::json_text(out, false);
}

std::string guide_json(const GuidedStart& guide) {
    Json out = Json::object();
    out["step"] = static_cast<int>(guide.step());
    out["steps"] = kGuideSteps;
    out["title"] = guide_title(guide.step());
    out["words"] = guide_words(guide.step());
    return detail::json_text(out, false);
}

namespace {

Json json_of(const Message& message) {
    Json list = Json::array({std::string(message.format())});
    for (const Message& argument : message.arguments()) list.push_back(json_of(argument));
    return list;
}

}  // namespace

std::string events_json(const PagePlayer& player) {
    Json events = Json::array();
    if (player.attempt() != nullptr)
        for (const Message& words : player.attempt()->words()) events.push_back(json_of(words));
    return detail::json_text(events, false);
}

std::string procedure_json(const PagePlayer& player) {
    const Exercise& exercise = player.exercise();
    const ProcedureRun& run = player.engine().procedure();
    Json out = Json::object();
    if (!run.given()) return detail::json_text(out, false);
    const Procedure& p = exercise.procedure;
    const ProcedureView view = run.view();
    Json steps = Json::array(), tray = Json::array(), complications = Json::array(),
         taken = Json::array();
    for (std::size_t s = 0; s < p.steps.size(); ++s) {
        Json step = Json::object();
        step["title"] = p.steps[s].title;
        step["instruction"] = p.steps[s].instruction;
        step["state"] = step_state_name(view.steps[s]);
        steps.push_back(std::move(step));
    }
    for (const TrayAct& one : tray_now(p, view.state)) {
        Json act = Json::object();
        act["kind"] = static_cast<int>(one.act.kind);
        act["index"] = one.act.index;
        act["amount"] = one.act.amount;
        act["words"] = one.words;
        tray.push_back(std::move(act));
    }
    for (std::size_t k = 0; k < view.state.complication_s.size(); ++k)
        if (view.state.complication_s[k] >= 0) complications.push_back(complication_titles()[k]);
    for (const ProcedureResult::Taken& one : run.taken()) {
        Json part = Json::object();
        part["region"] = one.region;
        part["mm"] = one.mm;
        taken.push_back(std::move(part));
    }
    const ProcedureState& s = view.state;
    Json questions = Json::array();
    for (int i = view.question; i >= 0; i = next_question(p, s, i)) {
        const ProcedureItem& item = p.items[static_cast<std::size_t>(i)];
        Json question = Json::object();
        question["item"] = i;
        question["words"] = item.question;
        question["options"] = item.options;
        questions.push_back(std::move(question));
    }
    out["questions"] = std::move(questions);
    out["steps"] = std::move(steps);
    out["present"] = view.present_step;
    out["tray"] = std::move(tray);
    out["complications"] = std::move(complications);
    out["taken"] = std::move(taken);
    out["throws"] = s.throws;
    out["injected_ml"] = s.injected_ml + s.injected_lost_ml;
    out["aspirated"] =
        s.aspirated < 0 ? std::string() : aspirate_names()[static_cast<std::size_t>(s.aspirated)];
    out["drained_ml"] = s.drained_ml;
    out["wire_mm"] = s.wire_in ? s.wire_mm : 0.0;
    out["catheter_in"] = s.catheter_in;
    out["compressed_s"] = s.compressed_s;
    return detail::json_text(out, false);
}

std::string course_json(const Course& course) {
    Json out = Json::object();
    out["name"] = course.name;
    out["title"] = course.title;
    out["text"] = course.text;
    Json modules = Json::array();
    for (const CourseModule& m : course.modules) {
        Json one = Json::object();
        one["name"] = m.name;
        one["title"] = m.title;
        one["text"] = m.text;
        one["case"] = m.case_name;
        one["exercise"] = m.exercise;
        one["expert"] = m.expert;
        one["question"] = m.question;
        one["options"] = m.options;
        one["answer"] = m.answer;
        one["because"] = m.because;
        one["measure"] = m.measure;
        one["at_most"] = detail::json_number(m.at_most);
        one["at_least"] = detail::json_number(m.at_least);
        one["gate"]["passes_in_a_row"] = m.gate.passes_in_a_row;
        one["gate"]["steady"] = m.gate.steady;
        one["gate"]["exam"] = m.gate.exam;
        one["retention_days"] = m.retention_days;
        modules.push_back(std::move(one));
    }
    out["modules"] = std::move(modules);
    return detail::json_text(out, false);
}

namespace {

double part_of(const CourseGate& gate, const ModuleStanding& now) {
    if (now.passed) return 1;
    double part = 0;
    if (gate.passes_in_a_row > 0) part = double(now.attempts.in_a_row) / gate.passes_in_a_row;
    if (gate.steady) part = std::max(part, now.attempts.cusum / kSteadyCusum);
    return std::clamp(part, 0.0, 1.0);
}

Json json_of_standing(const CourseModule& module, const ModuleStanding& now) {
    Json one = Json::object();
    one["option"] = now.option;
    one["open"] = now.open;
    one["passed"] = now.passed;
    one["due"] = now.due;
    one["passed_on"] = now.passed_on;
    one["due_on"] = now.due_on;
    one["kept_on"] = now.kept_on;
    one["attempts"] = now.attempts.attempts;
    one["in_a_row"] = now.attempts.in_a_row;
    one["cusum"] = now.attempts.cusum;
    one["cusum_needed"] = kSteadyCusum;
    one["measured"] = detail::json_number(now.measured);
    one["in_limits"] = now.in_limits;
    one["part"] = part_of(module.gate, now);
    return one;
}

// "attempts" of what a page has kept.
std::vector<ProgressEntry> history_of(detail::JsonObject& kept) {
    constexpr std::int64_t kSeeds = std::int64_t{1} << 53;
    std::vector<ProgressEntry> history;
    for (detail::JsonObject& one : kept.objects("attempts")) {
        ProgressEntry entry;
        entry.case_name = one.text("case");
        entry.exercise = one.text("exercise");
        entry.started = one.text("started");
        entry.passed = one.flag_or("passed", false);
        entry.exam = one.flag_or("exam", false);
        entry.seed = static_cast<std::uint64_t>(one.integer_or("seed", 0, 0, kSeeds));
        if (one.has("values")) {
            detail::JsonObject values = one.object("values");
            for (const std::string& name : values.keys())
                entry.metrics.push_back({name, values.number(name.c_str())});
        }
        history.push_back(std::move(entry));
    }
    return history;
}

}  // namespace

Result<std::string> course_standing_json(const Course& course, std::string_view kept) {
    detail::JsonFault fault{"the course's progress", {}};
    Json parsed;
    std::vector<ProgressEntry> history;
    std::vector<CourseAnswer> answers;
    std::string today;
    if (detail::parse_json(kept, parsed, fault)) {
        detail::JsonObject root(parsed, "", fault);
        today = root.text("today");
        history = history_of(root);
        std::vector<detail::JsonObject> given;
        if (root.has("answers")) given = root.objects("answers");
        for (detail::JsonObject& one : given) {
            const std::string module = one.text("module");
            answers.push_back(
                {"", course.name, module, static_cast<int>(one.integer("option", 0, 3))});
        }
    }
    if (fault.error) return *fault.error;
    const CourseStanding standing = course_standing(course, history, answers, today);
    Json out = Json::object();
    out["passed"] = standing.passed;
    out["due"] = standing.due;
    out["next"] = standing.next;
    Json modules = Json::array();
    for (std::size_t i = 0; i < course.modules.size(); ++i)
        modules.push_back(json_of_standing(course.modules[i], standing.modules[i]));
    out["modules"] = std::move(modules);
    return detail::json_text(out, false);
}

Result<std::string> standings_json(std::string_view kept) {
    detail::JsonFault fault{"the attempts that this browser keeps", {}};
    Json parsed, out = Json::array();
    if (detail::parse_json(kept, parsed, fault)) {
        detail::JsonObject root(parsed, "", fault);
        const std::vector<ProgressEntry> history = history_of(root);
        for (detail::JsonObject& one : root.objects("asked")) {
            const std::string of_case = one.text("case"), exercise = one.text("exercise");
            const int mastery = static_cast<int>(one.integer("mastery", 1, INT_MAX));
            const Standing now = standing(history, of_case, exercise, mastery);
            Json answer = Json::object();
            answer["attempts"] = now.attempts;
            answer["passes"] = now.passes;
            answer["mastered"] = now.mastered;
            answer["best_mm"] = detail::json_number(now.best_mm < 0 ? NAN : now.best_mm);
            out.push_back(std::move(answer));
        }
    }
    if (fault.error) return *fault.error;
    return detail::json_text(out, false);
}

}  // namespace sonocase::runtime::inline web
