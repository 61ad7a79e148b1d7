// Runs in the browser: loads the scene into the peer's viewer once, then draws as many frames as peer.mjs asks for, and times
// them. Decides nothing: the scene, the camera and the peer's options come from the server.

import * as THREE from 'three';
import * as Peer from 'gaussian-splats-3d';

const post = (path, body) => fetch(path, { method: 'POST', body });
const failed = (why) => post('/failed', String(why?.stack ?? why?.reason?.stack ?? why?.reason ?? why?.message ?? why));
addEventListener('error', (event) => failed(event.error ?? event.message));
addEventListener('unhandledrejection', failed);

/** The viewer with its scene loaded and sorted, drawing into a canvas that is in no document: nothing is ever composited. */
async function prepare({ camera, options }) {
	const { width, height } = camera;
	// The viewer takes the size of its pictures from this element.
	const root = document.createElement('div');
	root.style.cssText = `width:${width}px;height:${height}px;visibility:hidden`;
	document.body.append(root);
	// As the viewer would make it.
	const renderer = new THREE.WebGLRenderer({ antialias: false, precision: 'highp' });
	renderer.setPixelRatio(1);
	renderer.setClearColor(new THREE.Color(0), 0);
	renderer.setSize(width, height, false);
	const viewer = new Peer.Viewer({
		rootElement: root,
		renderer,
		camera: pinhole(camera),
		selfDrivenMode: false,
		useBuiltInControls: false,
		ignoreDevicePixelRatio: true,
		sceneRevealMode: Peer.SceneRevealMode.Instant,
		logLevel: Peer.LogLevel.None,
		...options,
	});
	await viewer.addSplatScene('/scene.ply', { format: Peer.SceneFormat.Ply, progressiveLoad: false, showLoadingUI: false });
	return { viewer, gl: renderer.getContext(), width, height };
}

/** cameras.json says: centre in the world, world from camera, camera x right, y down, z forward. */
function pinhole({ width, height, fx, fy, position, rotation, near, far }) {
	const fov = THREE.MathUtils.radToDeg(2 * Math.atan(height / (2 * fy)));
	const camera = new THREE.PerspectiveCamera(fov, (width * fy) / (height * fx), near, far);
	const [a, b, c] = rotation;
	const [x, y, z] = position;
	const worldFromCamera = new THREE.Matrix4().set(
		a[0], -a[1], -a[2], x,
		b[0], -b[1], -b[2], y,
		c[0], -c[1], -c[2], z,
		0, 0, 0, 1,
	);
	worldFromCamera.decompose(camera.position, camera.quaternion, camera.scale);
	camera.updateMatrixWorld(true);
	camera.updateProjectionMatrix();
	return camera;
}

/** Sorts everything for the camera as it stands, and waits until the order is here. */
async function sort(viewer) {
	const started = performance.now();
	// Forced, because the camera has not moved; all, because the viewer's partial sorts leave the order wrong.
	await viewer.runSplatSort(true, true);
	// It is made where the sort is started, and forgotten where the worker goes.
	await viewer.sortPromise;
	return { wall: performance.now() - started, worker: viewer.lastSortTime };
}

function draw({ viewer, gl }) {
	const onePixel = new Uint8Array(4);
	const started = performance.now();
	// What viewer.update() does for a frame, but for asking for a sort.
	viewer.updateSplatMesh();
	viewer.render();
	// Drawing is asynchronous; only a pixel that has been read has been drawn.
	gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, onePixel);
	return performance.now() - started;
}

/** The last frame over black, as PNG. The viewer blends over a cleared canvas, so what is there is premultiplied. */
async function picture({ gl, width, height }) {
	const pixels = new Uint8ClampedArray(4 * width * height);
	gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
	const upright = new ImageData(width, height);
	for (let row = 0; row < height; row++) {
		upright.data.set(pixels.subarray(4 * width * row, 4 * width * (row + 1)), 4 * width * (height - 1 - row));
	}
	for (let alpha = 3; alpha < upright.data.length; alpha += 4) upright.data[alpha] = 255;
	const canvas = new OffscreenCanvas(width, height);
	canvas.getContext('2d').putImageData(upright, 0, 0);
	return canvas.convertToBlob({ type: 'image/png' });
}

async function work() {
	const job = await (await fetch('/scene.json')).json();
	const started = performance.now();
	const stage = await prepare(job);
	const debug = stage.gl.getExtension('WEBGL_debug_renderer_info');
	await post('/ready', JSON.stringify({
		load_ms: performance.now() - started,
		gaussians: stage.viewer.splatMesh.getSplatCount(),
		sh_degree: stage.viewer.splatMesh.minSphericalHarmonicsDegree,
		gl: stage.gl.getParameter(debug ? debug.UNMASKED_RENDERER_WEBGL : stage.gl.RENDERER),
		browser: navigator.userAgent,
	}));
	for (;;) {
		const { frames, keep } = await (await fetch('/next')).json();
		const times = { draw_ms: [], sort_ms: [], sort_worker_ms: [], total_ms: [] };
		for (let frame = 0; frame < frames; frame++) {
			const order = await sort(stage.viewer);
			const drawn = draw(stage);
			times.sort_ms.push(order.wall);
			times.sort_worker_ms.push(order.worker);
			times.draw_ms.push(drawn);
			times.total_ms.push(order.wall + drawn);
		}
		// In the same turn as the draw: a canvas that keeps no drawing buffer may be cleared after it.
		if (keep) await post('/picture', await picture(stage));
		await post('/done', JSON.stringify(times));
	}
}

work().catch(failed);
