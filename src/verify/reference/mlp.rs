//! Small fully connected networks without bias: rectified hidden layers, a linear output.

/// One layer, `y = W x`.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Length of `x`.
    pub inputs: usize,
    /// Length of `y`.
    pub outputs: usize,
    /// `W`, `[outputs, inputs]`, row-major.
    pub weights: Vec<f64>,
}

/// A network: `max(W x, 0)` in every layer but the last, `W x` there.
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    /// The layers, from input to output.
    pub layers: Vec<Layer>,
}

impl Mlp {
    /// Number of weights of a network with these layer widths, the input's and the output's included.
    pub fn weight_count(widths: &[usize]) -> usize {
        widths.windows(2).map(|pair| pair[0] * pair[1]).sum()
    }

    /// A network with these layer widths, whose weights follow each other, layer by layer, in `weights`.
    ///
    /// Missing weights are 0.
    pub fn from_weights(widths: &[usize], weights: &[f64]) -> Self {
        let mut rest = weights.iter().copied();
        let layers = (widths.windows(2))
            .map(|pair| Layer {
                inputs: pair[0],
                outputs: pair[1],
                weights: (0..pair[0] * pair[1]).map(|_| rest.next().unwrap_or(0.0)).collect(),
            })
            .collect();
        Self { layers }
    }

    /// All activations: the input, each hidden layer after rectification, and last the output.
    pub fn forward(&self, input: &[f64]) -> Vec<Vec<f64>> {
        let mut activations = vec![input.to_vec()];
        for (l, layer) in self.layers.iter().enumerate() {
            let hidden = l + 1 < self.layers.len();
            let x = &activations[l];
            let y = (layer.weights.chunks_exact(layer.inputs))
                .map(|row| {
                    let sum: f64 = row.iter().zip(x).map(|(w, x)| w * x).sum();
                    if hidden { sum.max(0.0) } else { sum }
                })
                .collect();
            activations.push(y);
        }
        activations
    }

    /// Adds to ∂loss/∂weights and returns ∂loss/∂input, given ∂loss/∂output.
    ///
    /// `activations` is what [`Self::forward`] returned. Back from the output, with `d_y` the gradient
    /// by `W x`:
    /// `d_W += d_y xᵀ`, `d_x = Wᵀ d_y`, and `d_x = 0` where a rectified `x` is 0.
    pub fn backward(
        &self,
        activations: &[Vec<f64>],
        d_output: &[f64],
        d_weights: &mut [Vec<f64>],
    ) -> Vec<f64> {
        let mut d_y = d_output.to_vec();
        for (l, layer) in self.layers.iter().enumerate().rev() {
            let x = &activations[l];
            let mut d_x = vec![0.0; layer.inputs];
            for (o, &d) in d_y.iter().enumerate() {
                for i in 0..layer.inputs {
                    let w = o * layer.inputs + i;
                    d_weights[l][w] += d * x[i];
                    d_x[i] += d * layer.weights[w];
                }
            }
            let rectified = l > 0;
            for (d, &x) in d_x.iter_mut().zip(x) {
                if rectified && x <= 0.0 {
                    *d = 0.0;
                }
            }
            d_y = d_x;
        }
        d_y
    }

    /// Zero gradients, one vector per layer, of the shape that [`Self::backward`] adds to.
    pub fn zero_gradients(&self) -> Vec<Vec<f64>> {
        (self.layers.iter()).map(|layer| vec![0.0; layer.weights.len()]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W1 = [[1, 2], [−1, 1], [1, 0]], x = [1, −1/2]: W1 x = [0, −3/2, 1], rectified [0, 0, 1];
    /// W2 = [[2, 3, 4]] gives 4. With d_y = 1: d_W2 = [0, 0, 1], d_hidden = [0, 0, 4] as relu′(0) = 0.
    #[test]
    fn two_layers_by_hand() {
        let weights = [1.0, 2.0, -1.0, 1.0, 1.0, 0.0, 2.0, 3.0, 4.0];
        let mlp = Mlp::from_weights(&[2, 3, 1], &weights);
        assert_eq!(Mlp::weight_count(&[2, 3, 1]), 9);
        let activations = mlp.forward(&[1.0, -0.5]);
        assert_eq!(activations[1], [0.0, 0.0, 1.0]);
        assert_eq!(activations[2], [4.0]);
        let mut d_weights = mlp.zero_gradients();
        let d_input = mlp.backward(&activations, &[1.0], &mut d_weights);
        assert_eq!(d_weights[1], [0.0, 0.0, 1.0]);
        assert_eq!(d_weights[0], [0.0, 0.0, 0.0, 0.0, 4.0, -2.0]);
        assert_eq!(d_input, [4.0, 0.0]);
    }
}
