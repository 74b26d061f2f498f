// SPDX-License-Identifier: Apache-2.0

// A small learning platform, in node or in a browser, that holds a page to public rules; what breaks one is kept in
// `faults`.
//   API         SCORM 1.2 RTE 3.3 and 3.4: states, data types, lengths, error codes
//   API_1484_11 SCORM 2004 4th edition RTE 3 and 4: the same
//   cmi5        Quartz 8 to 11: launch, key, order of verbs, results, categories, state documents

const kText = (most) => (value) => value.length <= most;
const kOneOf = (...words) => (value) => words.includes(value);
const kNumber = (low, high) => (value) => /^-?\d+(\.\d+)?$/.test(value) && Number(value) >= low && Number(value) <= high;
const kId = (value) => value.length <= 255 && /^\S+$/.test(value);

// name: [may be read, may be written, type]; numbers of a list are written as n.
const kModel12 = {
    'cmi.core.student_id': ['r'], 'cmi.core.student_name': ['r'], 'cmi.core.lesson_location': ['rw', kText(255)], 'cmi.core.credit': ['r'],
    'cmi.core.lesson_status': ['rw', kOneOf('passed', 'completed', 'failed', 'incomplete', 'browsed')], 'cmi.core.entry': ['r'],
    'cmi.core.score.raw': ['rw', kNumber(0, 100)], 'cmi.core.score.min': ['rw', kNumber(0, 100)], 'cmi.core.score.max': ['rw', kNumber(0, 100)],
    'cmi.core.total_time': ['r'], 'cmi.core.lesson_mode': ['r'], 'cmi.core.exit': ['w', kOneOf('time-out', 'suspend', 'logout', '')],
    'cmi.core.session_time': ['w', (value) => /^\d{2,4}:\d{2}:\d{2}(\.\d{1,2})?$/.test(value)], 'cmi.suspend_data': ['rw', kText(4096)], 'cmi.launch_data': ['r'],
    'cmi.objectives.n.id': ['rw', kId], 'cmi.objectives.n.score.raw': ['rw', kNumber(0, 100)],
    'cmi.objectives.n.status': ['rw', kOneOf('passed', 'completed', 'failed', 'incomplete', 'browsed', 'not attempted')],
    'cmi.objectives._children': ['r'], 'cmi.objectives._count': ['r'],
};
const kModel2004 = {
    'cmi._version': ['r'], 'cmi.learner_id': ['r'], 'cmi.learner_name': ['r'], 'cmi.location': ['rw', kText(1000)], 'cmi.credit': ['r'], 'cmi.entry': ['r'], 'cmi.mode': ['r'],
    'cmi.completion_status': ['rw', kOneOf('completed', 'incomplete', 'not attempted', 'unknown')], 'cmi.success_status': ['rw', kOneOf('passed', 'failed', 'unknown')],
    'cmi.exit': ['w', kOneOf('time-out', 'suspend', 'logout', 'normal', '')], 'cmi.progress_measure': ['rw', kNumber(0, 1)], 'cmi.scaled_passing_score': ['r'],
    'cmi.score.scaled': ['rw', kNumber(-1, 1)], 'cmi.score.raw': ['rw', kNumber(-1e9, 1e9)], 'cmi.score.min': ['rw', kNumber(-1e9, 1e9)], 'cmi.score.max': ['rw', kNumber(-1e9, 1e9)],
    'cmi.session_time': ['w', (value) => /^P(\d+D)?(T(?=\d)(\d+H)?(\d+M)?(\d+(\.\d{1,2})?S)?)?$/.test(value)], 'cmi.suspend_data': ['rw', kText(64000)], 'cmi.total_time': ['r'],
};

// The object that a SCORM platform offers. kept: what the platform has of this learner and object; written on commit.
// reopens: a session that was ended may be begun again, as some platforms allow.
export function scorm_api(is_2004, kept, {online = () => true, reopens = false} = {}) {
    const model = is_2004 ? kModel2004 : kModel12;
    const code_of = is_2004 ? {initialized: 103, terminated: 104, get_early: 122, get_late: 123, set_early: 132, set_late: 133, unknown: 401, unset: 403, read_only: 404, write_only: 405, type: 406, range: 407, commit_early: 142, commit_late: 143, end_early: 112, end_late: 113, argument: 201, commit: 391}
        : {initialized: 101, terminated: 101, get_early: 301, get_late: 301, set_early: 301, set_late: 301, unknown: 401, unset: 0, read_only: 403, write_only: 404, type: 405, range: 405, commit_early: 301, commit_late: 301, end_early: 301, end_late: 301, argument: 201, commit: 101};
    const api = {faults: [], calls: [], ended: 0, state: 'new', code: 0, values: new Map(kept)};
    const first = is_2004
        ? {'cmi.learner_id': 'u-7', 'cmi.learner_name': 'Ada', 'cmi.mode': 'normal', 'cmi.credit': 'credit', 'cmi.entry': kept.size ? 'resume' : 'ab-initio', 'cmi.completion_status': 'unknown', 'cmi.success_status': 'unknown', 'cmi.scaled_passing_score': '1', 'cmi.total_time': 'PT0S'}
        : {'cmi.core.student_id': 'u-7', 'cmi.core.student_name': 'Ada', 'cmi.core.lesson_mode': 'normal', 'cmi.core.credit': 'credit', 'cmi.core.entry': kept.size ? 'resume' : 'ab-initio', 'cmi.core.lesson_status': 'not attempted', 'cmi.core.total_time': '0000:00:00', 'cmi.suspend_data': '', 'cmi.core.lesson_location': '', 'cmi.core.score.raw': '', 'cmi.objectives._children': 'id,score,status', 'cmi.objectives._count': '0'};
    for (const [name, value] of Object.entries(first)) if (!api.values.has(name)) api.values.set(name, value);
    const answer = (code, good, bad) => {
        api.code = code;
        return code === 0 ? good : bad;
    };
    // Faults are what no conforming page does; a platform's refusals of what it may ask are none.
    const fault = (words) => api.faults.push(words);
    const store = () => { for (const [name, value] of api.values) kept.set(name, value); };
    const calls = {
        Initialize(empty) {
            if (empty !== '') fault('Initialize takes ""');
            if (api.state === 'open') return answer(code_of.initialized, 'true', 'false');
            if (api.state === 'over' && !reopens) return answer(code_of.terminated, 'true', 'false');
            api.state = 'open';
            return answer(0, 'true');
        },
        Terminate(empty) {
            if (empty !== '') fault('Terminate takes ""');
            if (api.state !== 'open') return answer(api.state === 'new' ? code_of.end_early : code_of.end_late, 'true', 'false');
            if (online()) store();
            api.state = 'over';
            ++api.ended;
            const time = is_2004 ? 'cmi.session_time' : 'cmi.core.session_time';
            if (!api.values.has(time)) fault('no session time before the end');
            return answer(0, 'true');
        },
        Commit(empty) {
            if (empty !== '') fault('Commit takes ""');
            if (api.state !== 'open') return answer(api.state === 'new' ? code_of.commit_early : code_of.commit_late, 'true', 'false');
            if (!online()) return answer(code_of.commit, 'true', 'false');
            store();
            return answer(0, 'true');
        },
        GetValue(name) {
            if (api.state !== 'open') return answer(api.state === 'new' ? code_of.get_early : code_of.get_late, '', '');
            const entry = model[name.replaceAll(/\.\d+(?=\.)/g, '.n')];
            if (!entry) { fault(`reads ${name}`); return answer(code_of.unknown, '', ''); }
            if (!entry[0].includes('r')) { fault(`reads ${name}`); return answer(code_of.write_only, '', ''); }
            if (!api.values.has(name)) return answer(code_of.unset, '', '');
            return answer(0, api.values.get(name));
        },
        SetValue(name, value) {
            api.calls.push([name, value]);
            if (typeof value !== 'string') fault(`${name} is no text`);
            if (api.state !== 'open') { fault(`writes ${name} in no session`); return answer(api.state === 'new' ? code_of.set_early : code_of.set_late, '', 'false'); }
            const entry = model[name.replaceAll(/\.\d+(?=\.)/g, '.n')];
            if (!entry) { fault(`writes ${name}`); return answer(code_of.unknown, '', 'false'); }
            if (!entry[0].includes('w')) { fault(`writes ${name}`); return answer(code_of.read_only, '', 'false'); }
            if (!entry[1](value)) { fault(`${name} is ${value}`); return answer(code_of.type, '', 'false'); }
            const index = /^cmi\.objectives\.(\d+)\./.exec(name)?.[1];
            if (index !== undefined) {
                const count = Number(api.values.get('cmi.objectives._count') ?? 0);
                if (Number(index) > count || (Number(index) === count && !name.endsWith('.id'))) { fault(`${name} has no id yet`); return answer(code_of.argument, '', 'false'); }
                if (Number(index) === count) api.values.set('cmi.objectives._count', String(count + 1));
            }
            api.values.set(name, value);
            return answer(0, 'true');
        },
        GetLastError: () => String(api.code),
        GetErrorString: (code) => `error ${code}`,
        GetDiagnostic: () => '',
    };
    for (const [name, call] of Object.entries(calls)) api[is_2004 ? name : `LMS${name.replace('Terminate', 'Finish')}`] = call;
    return api;
}

const kVerb = 'http://adlnet.gov/expapi/verbs/', kContext = 'https://w3id.org/xapi/cmi5/context/';
const kUuid = /^[0-9a-f]{8}-[0-9a-f]{4}-[1-5][0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}$/i;

// The platform and record store of cmi5. handle(method, url, headers, body) answers {status, text}; launch() begins a
// session and gives what goes into the page's address.
export class Cmi5Platform {
    constructor(base, {masteryScore = 1, launchMode = 'Normal', returnURL} = {}) {
        Object.assign(this, {base, masteryScore, launchMode, returnURL, faults: [], statements: [], documents: new Map(), keys: new Map(), sessions: new Map(), online: true, requests: 0, next: 1,
            actor: {objectType: 'Agent', account: {homePage: 'https://platform.example.org', name: 'u-7'}},
            registration: '3f2504e0-4f89-41d3-9a0c-0305e82c3301', activityId: 'https://platform.example.org/au/1'});
    }
    launch() {
        // A session that was not terminated is abandoned when the next one begins.
        for (const session of this.sessions.values()) session.over ||= true;
        const n = this.next++, id = `session-${n}`;
        this.sessions.set(id, {verbs: [], over: false});
        this.keys.set(`fetch-${n}`, {token: Buffer.from(`key-${n}`).toString('base64'), taken: false, session: id});
        const contextTemplate = {contextActivities: {grouping: [{id: 'urn:sonocase:course:x:y'}]}, extensions: {[`${kContext}extensions/sessionid`]: id}};
        this.documents.set('LMS.LaunchData', JSON.stringify({contextTemplate, launchMode: this.launchMode, masteryScore: this.masteryScore, moveOn: 'Passed', ...this.returnURL ? {returnURL: this.returnURL} : {}}));
        return new URLSearchParams({endpoint: `${this.base}/lrs/`, fetch: `${this.base}/fetch?n=${n}`, actor: JSON.stringify(this.actor), registration: this.registration, activityId: this.activityId}).toString();
    }
    verbs() { return this.statements.map((one) => one.verb.id.slice(one.verb.id.lastIndexOf('/') + 1)); }
    handle(method, address, headers, body) {
        ++this.requests;
        const url = new URL(address, 'http://x'), need = (good, words) => { if (!good) this.faults.push(words); return good; };
        if (url.pathname.endsWith('/fetch')) {
            need(method === 'POST', 'the key is asked for by POST');
            const key = this.keys.get(`fetch-${url.searchParams.get('n')}`);
            if (!key || key.taken) return {status: 200, text: JSON.stringify({'error-code': '1', 'error-text': 'The key was given before.'})};
            key.taken = true;
            return {status: 200, text: JSON.stringify({'auth-token': key.token})};
        }
        const given = /^Basic (\S+)$/.exec(headers.authorization ?? '')?.[1], key = [...this.keys.values()].find((one) => one.token === given && one.taken);
        if (!key) return {status: 401, text: ''};
        need(headers['x-experience-api-version'] === '1.0.3', 'version of xAPI');
        const same = (name, wanted) => need(url.searchParams.get(name) === wanted, `${name} of ${url.pathname}`);
        if (/\/(activities\/state|agents\/profile)$/.test(url.pathname)) {
            need(JSON.stringify(JSON.parse(url.searchParams.get('agent') ?? 'null')) === JSON.stringify(this.actor), 'the agent is the actor of the launch');
            const is_state = url.pathname.endsWith('state'), id = url.searchParams.get(is_state ? 'stateId' : 'profileId');
            if (is_state) { same('activityId', this.activityId); same('registration', this.registration); }
            if (method === 'GET') return this.documents.has(id) ? {status: 200, text: this.documents.get(id)} : {status: 404, text: ''};
            need(method === 'PUT' && id !== 'LMS.LaunchData', `${method} of ${id}`);
            this.documents.set(id, body);
            return {status: 204, text: ''};
        }
        if (!need(url.pathname.endsWith('/statements') && method === 'POST', `${method} ${url.pathname}`)) return {status: 404, text: ''};
        for (const statement of [JSON.parse(body)].flat()) {
            const before = this.statements.find((one) => one.id === statement.id);
            if (before) {
                need(JSON.stringify(before) === JSON.stringify(statement), 'an id with other content');
                need(false, `${statement.verb.display?.en} is sent twice`);
                continue;
            }
            const status = this.take(statement, key.session, need);
            if (status) return {status, text: ''};
        }
        return {status: 200, text: '[]'};
    }
    take(one, session_of_key, need) {
        const verb = one.verb.id.slice(one.verb.id.lastIndexOf('/') + 1), {context = {}, result} = one;
        const session_id = context.extensions?.[`${kContext}extensions/sessionid`], session = this.sessions.get(session_id);
        need(session_id === session_of_key, `${verb} is of the session of its key`);
        if (!session || session.over) return 403;
        const categories = (context.contextActivities?.category ?? []).map(({id}) => id), defined = categories.includes(`${kContext}categories/cmi5`);
        need(kUuid.test(one.id), 'ids are UUIDs');
        need(/^\d{4}-\d\d-\d\dT[\d:.]+Z$/.test(one.timestamp ?? ''), `${verb} has a time in UTC`);
        need(JSON.stringify(one.actor) === JSON.stringify(this.actor), `the actor of ${verb} is that of the launch`);
        need(context.registration === this.registration, `registration of ${verb}`);
        need(context.contextActivities?.grouping?.some(({id}) => id === 'urn:sonocase:course:x:y'), `${verb} keeps the platform's template`);
        need(session.verbs.length > 0 || (verb === 'initialized' && defined), `the first is Initialized, not ${verb}`);
        const moves_on = categories.includes(`${kContext}categories/moveon`);
        if (defined) {
            need(one.object.id === this.activityId, `${verb} is about the unit`);
            need(!session.verbs.includes(verb), `${verb} once in a session`);
            const ever = this.statements.filter((other) => (other.context.contextActivities.category ?? []).some(({id}) => id.endsWith('/cmi5'))).map((other) => other.verb.id);
            if (verb === 'passed' || verb === 'completed') need(!ever.includes(kVerb + verb), `${verb} once in a registration`);
            if (verb === 'failed') need(!ever.includes(`${kVerb}passed`), 'no Failed after Passed');
            need(['initialized', 'completed', 'passed', 'failed', 'terminated'].includes(verb), `${verb} is cmi5's`);
            need(!(session.verbs.includes('passed') && verb === 'failed'), 'Passed or Failed, not both');
            if (this.launchMode !== 'Normal') need(['initialized', 'terminated'].includes(verb), `no ${verb} in ${this.launchMode}`);
            need((result?.success ?? null) === ({passed: true, failed: false}[verb] ?? null), `success of ${verb}`);
            need((result?.completion ?? null) === (verb === 'completed' ? true : null), `completion of ${verb}`);
            need(moves_on === ['passed', 'failed', 'completed'].includes(verb), `moveon category of ${verb}`);
            if (verb !== 'initialized') need(/^PT\d+(\.\d{1,2})?S$/.test(result?.duration ?? ''), `duration of ${verb}`);
            const score = result?.score;
            need(!score || verb === 'passed' || verb === 'failed', `${verb} has no score`);
            if (score) {
                need(score.scaled >= 0 && score.scaled <= 1 && Number.isInteger(score.raw) && score.raw >= score.min && score.raw <= score.max, 'score within its limits');
                need(verb === 'passed' ? score.scaled >= this.masteryScore : score.scaled < this.masteryScore, `${verb} with ${score.scaled} of ${this.masteryScore}`);
                need(context.extensions[`${kContext}extensions/masteryscore`] === this.masteryScore, 'the pass mark is named');
            }
            session.verbs.push(verb);
        } else {
            need(!moves_on, `${verb} moves nothing on`);
            session.verbs.push(`allowed ${verb}`);
        }
        if (verb === 'terminated') session.over = true;
        this.statements.push(one);
        return 0;
    }
}
