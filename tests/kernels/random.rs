//! Random numbers: the same integers on the device and in the reference.

use nerf::gpu::pass::Stage;
use nerf::kernels::Part;
use nerf::model;
use nerf::reference::random::{pcg, random_u32, uniform};

use crate::bench::{Bench, SEED, STEP, Setup};

const RANDOM: Part = ("common/random.wgsl", include_str!("../../shaders/common/random.wgsl"));
const COUNT: usize = 4096;

fn evaluate<T: bytemuck::Pod>(kind: &str, expression: &str) -> Vec<T> {
    let mut bench: Bench = Bench::new(&Setup::tiny());
    let text = format!(
        "var<storage, read_write> test_outputs: array<{kind}>;\n\
         @compute @workgroup_size(64)\n\
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
             let stream = {}u;\n\
             test_outputs[id.x] = {expression};\n\
         }}\n",
        pcg(STEP.wrapping_add(pcg(SEED)))
    );
    bench.0.workspace.add(bench.0.gpu.storage::<T>("test_outputs", COUNT).expect("outputs"));
    let kernel = bench.plan.generated_kernel(&bench.gpu, "test", &[RANDOM], &[], text).expect("a kernel");
    let bound = bench.workspace.bind(&bench.gpu, &kernel, &[]).expect("bindings");
    bench.run([&Stage::fixed(bound, COUNT / 64, 1)]);
    bench.read("test_outputs", COUNT)
}

#[test]
fn integers_are_equal() {
    let got: Vec<u32> = evaluate("u32", "random_u32(stream, id.x * 7919u, id.x % 11u)");
    for (index, &got) in got.iter().enumerate() {
        let index = index as u32;
        assert_eq!(got, random_u32(SEED, STEP, index.wrapping_mul(7919), index % 11), "{index}");
    }
    let got: Vec<u32> = evaluate("u32", "pcg(id.x * 1048573u)");
    for (index, &got) in got.iter().enumerate() {
        let value = (index as u32).wrapping_mul(1_048_573);
        assert_eq!((got, got), (pcg(value), model::pcg(value)), "{index}");
    }
}

#[test]
fn floats_are_equal() {
    let got: Vec<f32> = evaluate("f32", "random_f32(stream, id.x, 3u)");
    for (index, &got) in got.iter().enumerate() {
        assert_eq!(got, uniform(random_u32(SEED, STEP, index as u32, 3)), "{index}");
    }
    assert!(got.iter().all(|x| (0.0..1.0).contains(x)));
}
