// SPDX-License-Identifier: Apache-2.0

// Public rules of packages for learning platforms:
//   SCORM 1.2 content packaging (CAM 2.3), SCORM 2004 4th edition (CAM 3, SN 3), cmi5 course structure (Quartz 13, 14)
// Schema files are not asked for.
import {inflateRawSync} from 'node:zlib';

// name -> bytes, from the directory at the end of a zip file.
export function read_zip(bytes) {
    const end = bytes.lastIndexOf(Buffer.from([0x50, 0x4b, 5, 6])), files = new Map();
    if (end < 0) throw new Error('no zip file');
    let at = bytes.readUInt32LE(end + 16);
    for (let n = bytes.readUInt16LE(end + 10); n > 0; --n) {
        if (bytes.readUInt32LE(at) !== 0x02014b50) throw new Error('damaged directory');
        const method = bytes.readUInt16LE(at + 10), packed = bytes.readUInt32LE(at + 20), size = bytes.readUInt32LE(at + 24);
        const letters = bytes.readUInt16LE(at + 28), more = bytes.readUInt16LE(at + 30) + bytes.readUInt16LE(at + 32), from = bytes.readUInt32LE(at + 42);
        const name = bytes.toString('utf8', at + 46, at + 46 + letters);
        const data_at = from + 30 + bytes.readUInt16LE(from + 26) + bytes.readUInt16LE(from + 28);
        const data = bytes.subarray(data_at, data_at + packed), plain = method === 8 ? inflateRawSync(data) : data;
        if (plain.length !== size) throw new Error(`${name}: ${plain.length} bytes instead of ${size}`);
        files.set(name, plain);
        at += 46 + letters + more;
    }
    return files;
}

// Elements of well-formed XML: {name, attributes, children, text}.
export function read_xml(text) {
    const root = {name: '', attributes: {}, children: [], text: ''}, open = [root];
    const plain = (words) => words.replaceAll(/&(lt|gt|quot|apos|amp);/g, (all, name) => ({lt: '<', gt: '>', quot: '"', apos: "'", amp: '&'})[name]);
    const token = /<\?[^]*?\?>|<(\/?)([A-Za-z_][\w:.-]*)((?:\s+[A-Za-z_][\w:.-]*="[^"<]*")*)\s*(\/?)>|([^<]+)/y;
    while (token.lastIndex < text.length) {
        const at = token.lastIndex, found = token.exec(text);
        if (!found) throw new Error(`not XML: ${text.slice(at, at + 60)}`);
        const [all, closes, name, given, empty, words] = found;
        if (words !== undefined) open.at(-1).text += plain(words);
        if (!name) continue;
        if (closes) {
            if (open.pop().name !== name) throw new Error(`${name} is closed and was not open`);
            continue;
        }
        const attributes = Object.fromEntries([...given.matchAll(/([A-Za-z_][\w:.-]*)="([^"]*)"/g)].map(([, key, value]) => [key, plain(value)]));
        const element = {name, attributes, children: [], text: ''};
        open.at(-1).children.push(element);
        if (!empty) open.push(element);
        if (all.includes('&') && /&(?!(lt|gt|quot|apos|amp);)/.test(all)) throw new Error(`a bare &: ${all}`);
    }
    if (open.length !== 1 || root.children.length !== 1) throw new Error('not one whole element');
    return root.children[0];
}
const all_of = (element, name) => [...element.name === name ? [element] : [], ...element.children.flatMap((one) => all_of(one, name))];
const child = (element, name) => element.children.find((one) => one.name === name);

// What is wrong with a package; [] for nothing. kind: as sonocase names it.
export function package_faults(files, kind) {
    const faults = [], need = (good, words) => { if (!good) faults.push(words); };
    const names = [...files.keys()];
    const one = kind === 'cmi5' ? 'cmi5.xml' : 'imsmanifest.xml';
    need(files.has(one), `${one} lies at the root`);
    need(names.every((name) => /^[A-Za-z0-9._/-]+$/.test(name) && !name.startsWith('/') && !name.includes('..')), 'plain relative names');
    need(new Set(names).size === names.length, 'no name twice');
    if (!files.has(one)) return faults;
    const root = read_xml(files.get(one).toString('utf8'));
    const there = (href) => files.has(href.replace(/[?#].*/, ''));
    if (kind === 'cmi5') {
        need(root.name === 'courseStructure' && root.attributes.xmlns === 'https://w3id.org/xapi/profiles/cmi5/v1/CourseStructure.xsd', 'courseStructure of cmi5');
        const course = child(root, 'course'), aus = all_of(root, 'au');
        need(course && aus.length > 0, 'a course and its units');
        const ids = [course, ...aus].map((element) => element?.attributes.id ?? '');
        need(ids.every((id) => /^[a-z][a-z0-9+.-]*:\S+$/i.test(id)), 'ids are IRIs');
        need(new Set(ids).size === ids.length, 'ids differ');
        for (const element of [course, ...aus]) {
            for (const name of ['title', 'description']) {
                const strings = child(element, name)?.children ?? [];
                need(strings.length > 0 && strings.every((one) => one.name === 'langstring' && one.attributes.lang && one.text.trim()), `${name} in langstrings`);
            }
        }
        for (const au of aus) {
            const order = au.children.map(({name}) => name).join();
            need(order === 'title,description,url', `order in the unit: ${order}`);
            const {moveOn, masteryScore, launchMethod} = au.attributes;
            need(['NotApplicable', 'Passed', 'Completed', 'CompletedAndPassed', 'CompletedOrPassed'].includes(moveOn), `moveOn ${moveOn}`);
            need(masteryScore === undefined || /^(0(\.\d{1,4})?|1(\.0{1,4})?)$/.test(masteryScore), `masteryScore ${masteryScore}`);
            need(['AnyWindow', 'OwnWindow'].includes(launchMethod), `launchMethod ${launchMethod}`);
            const url = child(au, 'url').text;
            need(there(url), `${url} is in the package`);
            need(!/[?&](endpoint|fetch|actor|registration|activityId)=/.test(url), 'the url leaves the launch its names');
        }
        return faults;
    }
    const is_2004 = kind === 'scorm2004', {attributes} = root;
    need(root.name === 'manifest' && /^[A-Za-z_][\w.-]*$/.test(attributes.identifier ?? ''), 'manifest with an identifier');
    need(attributes.xmlns === (is_2004 ? 'http://www.imsglobal.org/xsd/imscp_v1p1' : 'http://www.imsproject.org/xsd/imscp_rootv1p1p2'), 'namespace of content packaging');
    need(attributes['xmlns:adlcp'] === (is_2004 ? 'http://www.adlnet.org/xsd/adlcp_v1p3' : 'http://www.adlnet.org/xsd/adlcp_rootv1p2'), 'namespace of ADL');
    need(root.children.map(({name}) => name).join() === 'metadata,organizations,resources', 'metadata, organizations, resources');
    const metadata = child(root, 'metadata');
    need(child(metadata, 'schema')?.text === 'ADL SCORM' && child(metadata, 'schemaversion')?.text === (is_2004 ? '2004 4th Edition' : '1.2'), 'schema and its version');
    const organizations = child(root, 'organizations'), list = all_of(organizations, 'organization');
    need(list.some((one) => one.attributes.identifier === organizations.attributes.default), 'the default organization exists');
    const resources = all_of(root, 'resource'), items = all_of(root, 'item');
    const ids = [...list, ...items, ...resources].map((element) => element.attributes.identifier);
    need(ids.every((id) => /^[A-Za-z_][\w.-]*$/.test(id ?? '')) && new Set(ids).size === ids.length, 'identifiers are XML IDs and differ');
    const resource_of = (id) => resources.find((one) => one.attributes.identifier === id);
    const type = is_2004 ? 'adlcp:scormType' : 'adlcp:scormtype';
    need(items.length > 0, 'items');
    const prefixes = Object.keys(attributes).filter((name) => name.startsWith('xmlns:')).map((name) => name.slice(6));
    for (const name of new Set([...files.get(one).toString('utf8').matchAll(/[<\s]\/?([a-z]+):[A-Za-z]+[\s=>/]/g)].map(([, prefix]) => prefix)))
        need(name === 'xmlns' || prefixes.includes(name), `prefix ${name} is declared`);
    items.forEach((item, n) => {
        need(child(item, 'title')?.text.trim(), 'an item has a title');
        need(item.children[0].name === 'title', 'the title comes first');
        const resource = resource_of(item.attributes.identifierref);
        need(resource?.attributes[type] === 'sco' && resource.attributes.href, `item ${item.attributes.identifier} opens a SCO`);
        need(/^\?[\w=&-]+$/.test(item.attributes.parameters ?? '?a'), 'parameters begin with ?');
        if (!is_2004) {
            const before = child(item, 'adlcp:prerequisites');
            need(n === 0 ? !before : before?.attributes.type === 'aicc_script' && before.text === items[n - 1].attributes.identifier, 'the item before has to be passed');
            const mark = Number(child(item, 'adlcp:masteryscore')?.text);
            need(mark >= 0 && mark <= 100, 'pass mark of 0 to 100');
            return;
        }
        const sequencing = child(item, 'imsss:sequencing');
        need(sequencing && item.children.at(-1) === sequencing, 'sequencing ends the item');
        const parts = sequencing.children.map(({name}) => name);
        const order = ['imsss:controlMode', 'imsss:sequencingRules', 'imsss:limitConditions', 'imsss:rollupRules', 'imsss:objectives', 'imsss:deliveryControls'];
        need(parts.every((name, k) => order.includes(name) && (k === 0 || order.indexOf(name) > order.indexOf(parts[k - 1]))), `order of sequencing: ${parts}`);
        const objectives = child(sequencing, 'imsss:objectives').children, known = objectives.map((one) => one.attributes.objectiveID);
        need(objectives[0].name === 'imsss:primaryObjective' && new Set(known).size === known.length, 'one primary objective, first');
        const mark = Number(child(objectives[0], 'imsss:minNormalizedMeasure')?.text);
        need(objectives[0].attributes.satisfiedByMeasure === 'true' && mark >= -1 && mark <= 1, 'pass mark of -1 to 1');
        for (const rule of all_of(sequencing, 'imsss:ruleCondition')) need(known.includes(rule.attributes.referencedObjective), 'rules name objectives of their item');
        const global = (objective) => child(objective, 'imsss:mapInfo')?.attributes.targetObjectiveID;
        const before = n > 0 && child(items[n - 1], 'imsss:sequencing');
        need(n === 0 || global(objectives[1]) === global(child(before, 'imsss:objectives').children[0]), 'the item before has to be passed');
    });
    for (const resource of resources) {
        const hrefs = resource.children.filter(({name}) => name === 'file').map((file) => file.attributes.href);
        need(resource.attributes.type === 'webcontent', 'resources are web content');
        need(['sco', 'asset'].includes(resource.attributes[type]), `${type} of a resource`);
        for (const href of hrefs) need(there(href), `${href} is in the package`);
        need(!resource.attributes.href || hrefs.includes(resource.attributes.href), 'a resource lists the file that it opens');
        for (const more of resource.children.filter(({name}) => name === 'dependency')) need(resource_of(more.attributes.identifierref), 'a dependency exists');
    }
    const listed = new Set(all_of(root, 'file').map((file) => file.attributes.href));
    for (const name of names) need(name === one || listed.has(name), `${name} is listed`);
    return faults;
}
