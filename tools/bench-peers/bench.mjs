// Ours and a peer by turns on one scene, camera and size; both scored against the f64 reference; a table and JSON.

import { execFile, spawnSync } from 'node:child_process';
import { constants, existsSync } from 'node:fs';
import { access, mkdir, open, readFile, writeFile } from 'node:fs/promises';
import os from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs, promisify } from 'node:util';
import { PeerBrowser, SOFTWARE_GL } from './peer.mjs';
import { PeerProgram } from './rust-peer.mjs';

const here = path.dirname(fileURLToPath(import.meta.url));
const repo = path.resolve(here, '../..');
const cache = path.join(process.env.MON3TR_CACHE, 'bench-peers');
const run = promisify(execFile);

/** Peers by name; another may be named by its program's file. */
const BROWSER_PEER = 'gaussian-splats-3d';
const RUST_PEER = 'wgpu-3dgs-viewer';

const HELP = `Usage: tools/bench-peers/run (--scene FILE.ply | --person COUNT) [OPTIONS]

Draws one scene with our renderer and with a peer, by turns.

  --scene FILE        a standard 3DGS PLY
  --person COUNT      the demo person instead, baked with so many Gaussians (150k) and posed; kept in the cache
  --cameras FILE      cameras.json as 3DGS writes it [default: the cameras for ../shared/data/splats/playbot3.ply and the person]
  --id N              which of them [default: 0, with --person 1]
  --size WxH          picture size; the camera keeps its vertical field of view [default: 1024x1024]
  --rounds N          turns of each [default: 5]
  --frames N          counted frames in a turn, after one that is not [default: 8]
  --peer NAME         ${BROWSER_PEER} (in headless Chromium on software GL), ${RUST_PEER} (on our programs' Vulkan
                      driver), or the file of a program that answers as rust-peer/ does [default: ${BROWSER_PEER}]
  --gl NAME           ${Object.keys(SOFTWARE_GL).join(' or ')}: what the browser draws with [default: ${Object.keys(SOFTWARE_GL)[0]}]
  --peer-options JSON more options of ${BROWSER_PEER}'s Viewer, e.g. {"integerBasedSort":false}
  --only SIDE         ours or peer
  --ours PROGRAM      run this with the same arguments instead of ./run bench render (an older build, say)
  --chromium FILE     the browser [default: chromium, as found in PATH]
  --out FOLDER        pictures and camera [default: out/bench-peers]
  --json FILE         write every figure
  --verbose           show what the browser says
`;

/** A mistake of the caller's or of the machine's: its message says what to do. */
class Trouble extends Error {}

function parsed(what, text) {
	try {
		return JSON.parse(text);
	} catch (why) {
		throw new Trouble(`${what} is not JSON: ${why.message}`);
	}
}

function arguments_() {
	const text = { type: 'string' };
	let values;
	try {
		({ values } = parseArgs({
			options: {
				scene: text, person: text, cameras: text, id: text, size: { ...text, default: '1024x1024' },
				rounds: { ...text, default: '5' }, frames: { ...text, default: '8' },
				peer: { ...text, default: BROWSER_PEER }, gl: { ...text, default: Object.keys(SOFTWARE_GL)[0] }, 'peer-options': { ...text, default: '{}' },
				only: text, ours: text, chromium: text, out: text, json: text,
				verbose: { type: 'boolean' }, help: { type: 'boolean', short: 'h' },
			},
		}));
	} catch (why) {
		throw new Trouble(`${why.message}\n\n${HELP}`);
	}
	if (values.help) {
		process.stdout.write(HELP);
		process.exit(0);
	}
	if (!values.scene === !values.person) throw new Trouble(`one of --scene and --person is needed\n\n${HELP}`);
	const size = /^(\d+)x(\d+)$/.exec(values.size);
	if (!size) throw new Trouble(`--size ${values.size} is not WIDTHxHEIGHT`);
	const count = (name) => {
		const number = Number(values[name]);
		if (!Number.isInteger(number) || number < 1) throw new Trouble(`--${name} ${values[name]} is not a number of 1 or more`);
		return number;
	};
	if (!(values.gl in SOFTWARE_GL)) throw new Trouble(`--gl ${values.gl}: there is ${Object.keys(SOFTWARE_GL).join(' and ')}`);
	if (![BROWSER_PEER, RUST_PEER].includes(values.peer) && !existsSync(values.peer)) {
		throw new Trouble(`--peer ${values.peer}: there is ${BROWSER_PEER} and ${RUST_PEER}, and no such file`);
	}
	if (values.only && !['ours', 'peer'].includes(values.only)) throw new Trouble('--only is ours or peer');
	return {
		...values,
		width: Number(size[1]),
		height: Number(size[2]),
		rounds: count('rounds'),
		frames: count('frames'),
		id: Number(values.id ?? (values.person ? 1 : 0)),
		cameras: values.cameras ?? path.join(here, 'cameras.json'),
		out: path.resolve(values.out ?? path.join(repo, 'out/bench-peers')),
		peerOptions: parsed('--peer-options', values['peer-options']),
		sides: values.only ? [values.only] : ['ours', 'peer'],
	};
}

/** Runs one of our programs from the repository's root, with what it says shown only if it fails. */
async function ours(program, args) {
	try {
		return (await run(program, args, { cwd: repo, maxBuffer: 1 << 28 })).stdout;
	} catch (why) {
		throw new Trouble(`${program} ${args.join(' ')} failed:\n${why.stderr || why.message}`);
	}
}

/** An example of our workspace, built in release, in the environment that ./run gives programs. */
function example(crate, name, args) {
	const cargo = `env=$(./run env) && eval "$env" && cargo run --quiet --release --package ${crate} --example ${name} -- "$@"`;
	return ours('bash', ['-c', cargo, name, ...args]);
}

async function person(count) {
	const ply = path.join(cache, `person-${count}.ply`);
	if (!existsSync(ply)) {
		console.error(`Baking and posing the person with ${count} Gaussians (minutes; kept in ${cache})`);
		const package_ = path.join(cache, `person-${count}.m3a`);
		await ours('./run', ['bake', '--gaussians', count, '--out', package_]);
		// Two seconds into the built-in motion: one arm up, so that depths differ.
		await example('app-pipeline', 'posed_ply', [package_, '2.0', `${ply}.part.ply`]);
		await run('mv', [`${ply}.part.ply`, ply]);
	}
	return ply;
}

async function header(scene) {
	const file = await open(scene).catch((why) => {
		throw new Trouble(`cannot read the scene ${scene}: ${why.message}`);
	});
	const { buffer, bytesRead } = await file.read(Buffer.alloc(16384), 0, 16384, 0);
	await file.close();
	const text = buffer.toString('latin1', 0, bytesRead).split('end_header')[0];
	const rest = text.match(/property float f_rest_/g)?.length ?? 0;
	const degree = [0, 9, 24, 45].indexOf(rest);
	if (!text.startsWith('ply') || !/property float f_dc_0/.test(text) || degree < 0) {
		throw new Trouble(`${scene} is not a standard 3DGS PLY, which is what the peer and the reference read`);
	}
	return { gaussians: Number(/element vertex (\d+)/.exec(text)?.[1]), degree };
}

/** The chosen camera at the chosen size, written where all renderers find it. */
async function cameraFor(args) {
	const text = await readFile(args.cameras, 'utf8').catch((why) => {
		throw new Trouble(`cannot read the cameras ${args.cameras}: ${why.message}`);
	});
	const all = parsed(args.cameras, text);
	const found = all.find((camera) => camera.id === args.id);
	if (!found) throw new Trouble(`${args.cameras} has no camera ${args.id}: it has ${all.map((camera) => camera.id).join(', ')}`);
	const scale = args.height / found.height;
	const camera = { ...found, width: args.width, height: args.height, fx: found.fx * scale, fy: found.fy * scale };
	const file = path.join(args.out, 'camera.json');
	await writeFile(file, `${JSON.stringify([camera], null, '\t')}\n`);
	return { camera, file };
}

async function findChromium(named) {
	for (const one of named ? [named] : ['chromium', 'chromium-browser', 'google-chrome']) {
		const folders = one.includes('/') ? [''] : process.env.PATH.split(':');
		for (const folder of folders) {
			const file = path.join(folder, one);
			if (await access(file, constants.X_OK).then(() => true, () => false)) {
				const version = spawnSync(file, ['--version'], { encoding: 'utf8' }).stdout.trim();
				return { file, version };
			}
		}
	}
	throw new Trouble(`there is no ${named ?? 'chromium'}: apt-get install chromium libegl1 libgl1-mesa-dri, or name one with --chromium`);
}

async function oursTurn(args, scene, cameraFile, picture) {
	const json = path.join(args.out, 'ours.json');
	const options = [
		'--scene', scene, '--view', cameraFile, '--id', String(args.id), '--size', `${args.width}x${args.height}`,
		'--frames', String(args.frames + 1), '--json', json, '--png', picture,
	];
	if (args.ours) await ours(path.resolve(args.ours), options);
	else await ours('./run', ['bench', 'render', ...options]);
	const report = JSON.parse(await readFile(json, 'utf8'));
	if (!Array.isArray(report.total_ms) || report.total_ms.length <= args.frames) {
		throw new Trouble(`${json} has no list total_ms of ${args.frames + 1} frames`);
	}
	return { total_ms: report.total_ms.slice(1), report };
}

async function peerTurn(args, peer, picture) {
	const times = await peer.frames(args.frames + 1, picture);
	return Object.fromEntries(Object.entries(times).map(([name, list]) => [name, list.slice(1)]));
}

/** Builds the Rust peer below the cache, and resolves to its program. */
async function rustPeer() {
	const target = path.join(cache, RUST_PEER);
	if (!existsSync(target)) console.error(`Building ${RUST_PEER} (minutes; kept in ${target})`);
	const build = 'env=$(./run env) && eval "$env" && cargo build --quiet --release --locked --manifest-path "$1" --target-dir "$2"';
	await ours('bash', ['-c', build, 'build', path.join(here, 'rust-peer/Cargo.toml'), target]);
	return path.join(target, 'release/rust-peer');
}

/** Share of all cores that others use now: the same work twice as fast or as slow is the rule on a shared machine. */
async function busy() {
	const sum = () => os.cpus().flatMap(({ times }) => Object.entries(times)).reduce(
		([idle, all], [kind, time]) => [idle + (kind === 'idle' ? time : 0), all + time], [0, 0]);
	const before = sum();
	await new Promise((resolve) => setTimeout(resolve, 2000));
	const after = sum();
	return 1 - (after[0] - before[0]) / (after[1] - before[1]);
}

const sorted = (list) => [...list].sort((a, b) => a - b);
const median = (list) => {
	const s = sorted(list);
	return (s[(s.length - 1) >> 1] + s[s.length >> 1]) / 2;
};
const ms = (value) => (value < 10 ? value.toFixed(2) : value.toFixed(1));

function summary(turns, name) {
	const medians = turns.map((turn) => median(turn[name]));
	return { median: median(turns.flatMap((turn) => turn[name])), turns: [Math.min(...medians), Math.max(...medians)] };
}

function ratio(turns, name) {
	const each = turns.ours.map((turn, k) => median(turn.total_ms) / median(turns.peer[k][name]));
	return { median: median(each), turns: [Math.min(...each), Math.max(...each)] };
}

function table(rows) {
	const widths = rows[0].map((_, column) => Math.max(...rows.map((row) => row[column].length)));
	for (const row of rows) {
		console.log(row.map((cell, column) => (column ? cell.padStart(widths[column]) : cell.padEnd(widths[column]))).join('  ').trimEnd());
	}
}

async function main() {
	const args = arguments_();
	const withPeer = args.sides.includes('peer');
	const inBrowser = withPeer && args.peer === BROWSER_PEER;
	// Before the bake, which takes minutes.
	const chromium = inBrowser ? await findChromium(args.chromium) : null;
	await mkdir(args.out, { recursive: true });
	await mkdir(cache, { recursive: true });
	const scene = args.person ? await person(args.person) : path.resolve(args.scene);
	const { gaussians, degree } = await header(scene);
	const { camera, file: cameraFile } = await cameraFor(args);
	const pictures = Object.fromEntries(args.sides.map((side) => [side, path.join(args.out, `${side}.png`)]));
	const program = withPeer && !inBrowser ? (args.peer === RUST_PEER ? await rustPeer() : path.resolve(args.peer)) : null;
	const others = await busy();

	const peer = inBrowser ? new PeerBrowser() : program ? new PeerProgram() : null;
	const turns = { ours: [], peer: [] };
	let about = null;
	try {
		if (peer) {
			if (inBrowser) {
				const options = { sphericalHarmonicsDegree: Math.min(degree, 2), ...args.peerOptions };
				about = await peer.start({
					chromium: chromium.file, modules: path.join(cache, 'modules/node_modules'), scene,
					camera: { ...camera, near: 0.05, far: 1000 }, options, gl: args.gl, verbose: args.verbose,
				});
				about = { ...about, chromium: chromium.version, options };
			} else {
				about = await peer.start({ program, repo, scene, cameraFile, id: args.id, verbose: args.verbose });
			}
			about = { name: path.basename(args.peer), ...about };
			if (about.gaussians !== gaussians) console.log(`Note: the peer keeps ${about.gaussians} of ${gaussians} Gaussians.`);
			if (about.sh_degree !== degree) console.log(`Note: the peer draws SH degree ${about.sh_degree} of a scene of degree ${degree}.`);
			// Shaders are compiled and memory is found in the first frames.
			await peer.frames(3);
		}
		for (let round = 0; round < args.rounds; round++) {
			for (const side of args.sides) {
				if (process.stderr.isTTY) process.stderr.write(`\rround ${round + 1} of ${args.rounds}, ${side}   `);
				turns[side].push(side === 'ours' ? await oursTurn(args, scene, cameraFile, pictures.ours) : await peerTurn(args, peer, pictures.peer));
			}
		}
		if (process.stderr.isTTY) process.stderr.write('\r\x1b[K');
	} finally {
		await peer?.close();
	}

	const reference = path.join(args.out, 'reference.png');
	const scores = JSON.parse(await example('mon3tr-tests', 'reference_picture', [
		scene, cameraFile, String(args.id), reference, ...args.sides.map((side) => pictures[side]),
	]));
	const score = Object.fromEntries(args.sides.map((side, k) => [side, scores.pictures[k]]));

	const kinds = [
		['ours', 'total_ms', 'ours: upload, project, sort, draw'],
		['peer', 'total_ms', 'peer: sort, draw'],
		['peer', 'draw_ms', '  of it draw'],
		['peer', 'sort_ms', '  of it sort, as waited for'],
		['peer', 'sort_worker_ms', '  of it sort, in its worker'],
	].filter(([side, name]) => turns[side].some((turn) => turn[name]));
	const times = kinds.map(([side, name, label]) => ({ side, name, label, ...summary(turns[side], name) }));
	const ratios = args.sides.length < 2 ? null : { total: ratio(turns, 'total_ms') };
	if (ratios && turns.peer[0].draw_ms) ratios.draw_alone = ratio(turns, 'draw_ms');

	const db = (value) => (value === null ? 'exact' : value.toFixed(1));
	console.log(`${path.basename(scene)}: ${gaussians} Gaussians, SH degree ${degree}, ${args.width}x${args.height}, camera ${args.id} (${camera.img_name})`);
	console.log(`${os.cpus()[0]?.model.trim()}, ${os.cpus().length} cores, ${Math.round(100 * others)} % busy with other work before`);
	if (about) console.log(`peer: ${[about.name, about.chromium, about.gl ?? about.device].filter(Boolean).join(', ')}`);
	console.log(`${args.rounds} turns each, alternating, of ${args.frames} frames\n`);
	table([
		['ms a frame', 'median', 'turns', 'dB covered', 'dB whole'],
		...times.map(({ side, name, label, median: middle, turns: [low, high] }) => [
			label, ms(middle), `${ms(low)}..${ms(high)}`,
			...(name === 'total_ms' ? [db(score[side].covered_db), db(score[side].whole_db)] : ['', '']),
		]),
		['the reference, rounded to 8 bits', '', '', db(scores.rounded.covered_db), db(scores.rounded.whole_db)],
	]);
	if (ratios) {
		const say = ({ median: middle, turns: [low, high] }) => `${middle.toFixed(3)} (turns ${low.toFixed(3)}..${high.toFixed(3)})`;
		console.log(`\nours / peer:                 ${say(ratios.total)}`);
		if (ratios.draw_alone) console.log(`ours / peer without sorting: ${say(ratios.draw_alone)}`);
	}
	console.log(`\npictures: ${[...Object.values(pictures), reference].map((file) => path.relative(process.cwd(), file)).join(' ')}`);
	if (args.json) {
		const report = { scene: path.basename(scene), gaussians, degree, camera, busy_before: others, peer: about, times, ratios, score, rounded: scores.rounded, turns };
		await writeFile(args.json, `${JSON.stringify(report, null, '\t')}\n`);
	}
}

main().catch((why) => {
	console.error(`\nbench-peers: ${why instanceof Trouble ? why.message : why.stack}`);
	process.exitCode = 1;
});
